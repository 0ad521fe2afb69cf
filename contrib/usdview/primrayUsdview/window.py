"""The window of a render: a line on what happens, the picture when it is there, and a button that ends the render."""

import shutil
import tempfile
from pathlib import Path

from pxr.Usdviewq.qt import QtCore, QtGui, QtWidgets

from .rendering import render_command, start, write_view

LOOK_EVERY_MS = 200


def show_render(usdviewApi):
    """Render what the viewport shows into a new window."""
    try:
        RenderWindow(usdviewApi).show()
    except Exception as error:  # usdview would only print a traceback
        QtWidgets.QMessageBox.critical(usdviewApi.qMainWindow, "primray", str(error))


class RenderWindow(QtWidgets.QDialog):
    """Shows one render. Closing it ends the render and removes its files."""

    def __init__(self, usdviewApi):
        super().__init__(usdviewApi.qMainWindow)
        self.setAttribute(QtCore.Qt.WA_DeleteOnClose)
        self.setWindowTitle("primray")
        self._folder = Path(tempfile.mkdtemp(prefix="primray-usdview-"))
        self._picture, self._log = self._folder / "picture.png", self._folder / "log.txt"
        self._process = None
        self.finished.connect(self._end)
        self.picture, self.text = QtWidgets.QLabel(), QtWidgets.QLabel("Exporting the stage ...")
        self.text.setWordWrap(True)
        self.button = QtWidgets.QPushButton("Cancel")
        self.button.clicked.connect(self.close)
        layout = QtWidgets.QVBoxLayout(self)
        for part in (self.picture, self.text, self.button):
            layout.addWidget(part)
        try:
            written = write_view(usdviewApi, self._folder)
            self._notes = "\n".join(written.notes)
            self._process = start(render_command(usdviewApi, written, self._picture), self._log)
        except Exception:
            self._end()
            raise
        self.text.setText("\n".join(filter(None, ["Rendering ...", self._notes])))
        self._timer = QtCore.QTimer(self)
        self._timer.timeout.connect(self._look)
        self._timer.start(LOOK_EVERY_MS)

    def _look(self):
        code = self._process.poll()
        if code is None:
            return
        self._timer.stop()
        self.button.setText("Close")
        said = self._log.read_text(errors="replace").strip()
        if self._picture.exists():
            self.picture.setPixmap(QtGui.QPixmap(str(self._picture)))
        else:
            said = f"primray ended with {code}.\n{said}"
        self.text.setText("\n".join(filter(None, [self._notes, said])))

    def closeEvent(self, event):
        self._end()
        super().closeEvent(event)

    def _end(self, *_):
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

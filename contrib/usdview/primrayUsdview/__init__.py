"""Plug-in of usdview: renders what its viewport shows with primray, in a process of its own.

docs/usdview.md says how it is installed. What takes long to import is imported when the command is used.
"""

from pxr import Tf
from pxr.Usdviewq.plugin import PluginContainer


class PrimrayContainer(PluginContainer):
    """Adds the menu "primray"."""

    def registerPlugins(self, plugRegistry, usdviewApi):
        self._render = plugRegistry.registerCommandPlugin(
            "primrayUsdview.render", "Render with primray", _render, "Render the viewport's camera and frame with primray."
        )

    def configureView(self, plugRegistry, plugUIBuilder):
        plugUIBuilder.findOrCreateMenu("primray").addItem(self._render, "Ctrl+Shift+R")


def _render(usdviewApi):
    from .window import show_render

    show_render(usdviewApi)


Tf.Type.Define(PrimrayContainer)

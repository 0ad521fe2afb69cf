// Lists are made again; the focus returns to the list that had it.

export function keepFocus(root, change) {
  const key = document.activeElement?.dataset?.key;
  change();
  if (key && root.ownerDocument.activeElement === document.body) root.querySelector(`[data-key="${CSS.escape(key)}"]`)?.focus();
}

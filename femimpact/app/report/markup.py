"""Elements of HTML and SVG as text that no text in them can turn into markup."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from typing import Any
from xml.etree.ElementTree import Element as Element

Child = Element | str | None
"""Child of an element: another one, a text, or nothing."""

NO_CHARACTER = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Characters that no document may hold: control characters, halves of surrogate pairs."""

RAW = frozenset({"script", "style"})
"""Elements whose text a browser reads as it stands."""


def element(
    kind: str,  # name of the element, and behind dots those of its classes: "p.lead"
    /,
    *children: Child,  # in their order; None is left out
    # value: an underscore stands for a hyphen, one at the end for nothing (`for_`). None and False are left out, True
    # is an attribute without a value.
    **attributes: Any,
) -> Element:
    """An element of HTML or SVG."""
    tag, *classes = kind.split(".")
    made = Element(tag, {"class": " ".join(classes)} if classes else {})
    for key, value in attributes.items():
        if value is not None and value is not False:
            made.set(key.rstrip("_").replace("_", "-"), "" if value is True else sound_text(value))
    last: Element | None = None
    for child in children:
        if isinstance(child, str):
            if last is None:
                made.text = (made.text or "") + sound_text(child)
            else:
                last.tail = (last.tail or "") + sound_text(child)
        elif child is not None:
            made.append(child)
            last = child
    return made


def data_element(data: Any) -> Element:
    """Plain data for a script of the page, as JSON that no text in it can end."""
    # of one text alone the writer escapes nothing, for a browser would not read it
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), sort_keys=True).replace("<", "\\u003c")
    return element("script", text, type="application/json")


def markup(root: Element) -> str:
    """An element as text of HTML.

    Raises `ValueError` if the text of a script or a style would end it.
    """
    for found in root.iter():
        if found.tag in RAW and f"</{found.tag}" in (found.text or "").lower():
            raise ValueError(f"the text of an element {found.tag} holds its own end")
    return ElementTree.tostring(root, encoding="unicode", method="html")


def sound_text(value: Any) -> str:
    """A value as text without what no document may hold."""
    return NO_CHARACTER.sub("\ufffd", str(value))

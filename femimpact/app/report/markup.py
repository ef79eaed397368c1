"""Elements of HTML and SVG as text that no text in them can turn into markup, figures of matplotlib among them."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from typing import Any
from xml.etree.ElementTree import Element as Element

from femimpact.figures.drawing import figure_of, svg_text

Child = Element | str | None
"""Child of an element: another one, a text, or nothing."""

NO_CHARACTER = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
"""Characters that no document may hold: control characters, halves of surrogate pairs."""

RAW = frozenset({"script", "style"})
"""Elements whose text a browser reads as it stands."""

FONT = re.compile(r"font-family: [^;]*(; |$)")
"""Names of fonts, for which those of the page's style stand."""

NUMBER = re.compile(r"-?\d+\.\d+")

AROUND = re.compile(r" *([a-zA-Z]) *"), re.compile(r" *([:;]) *")
"""Spaces that neither a path nor a style needs."""

IDENTIFIER = re.compile(r"url\(#([^)]+)\)")

LEFT_OUT = ("metadata", "style", "title")
"""Elements that matplotlib writes and a page has no use for: its style would hold for the whole page."""


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


# ---- figures of matplotlib ----------------------------------------------------------------------------


def picture_element(
    drawn: Any,  # what a function of `figures` returned
    key: str,  # begins the identifiers of its parts, which are then used once on a page
    title: str,
    words: tuple[str, ...] = (),  # below it
) -> Element:
    """A figure with its title and what is said of it."""
    frame = element("div.frame", svg_element(drawn, key, title), tabindex="0", role="region", aria_label=title)
    return element(
        "figure.picture", element("figcaption", title), frame, *(element("p.below", text) for text in words if text)
    )


def svg_element(drawn: Any, key: str, title: str) -> Element:
    """The figure of axes as an element, whose parts have identifiers that begin with the key."""
    for label in figure_of(drawn).findobj(lambda artist: hasattr(artist, "set_text")):
        # no font has a glyph for half of a pair
        label.set_text(sound_text(label.get_text()))
    root = ElementTree.fromstring(sound_text(svg_text(drawn)))
    used = IDENTIFIER.findall(" ".join(value for node in root.iter() for value in node.attrib.values()))
    used += [value[1:] for node in root.iter() for name, value in node.attrib.items() if name.endswith("href")]
    names = {found: f"{key}-{number}" for number, found in enumerate(dict.fromkeys(used), 1)}
    marks = {node.get("id", ""): node.get("style") for node in root.iter()}
    _clean(root, names, marks)
    # the width of the page decides how large it is, up to the size that it is drawn for
    width = root.attrib.pop("width").removesuffix("pt")
    for name in ("height", "version"):
        root.attrib.pop(name, None)
    style = f"max-width:{float(width):g}pt;stroke-linejoin:round;stroke-linecap:butt"
    root.attrib.update({"role": "img", "aria-label": sound_text(title), "style": style})
    return root


def _clean(
    node: Element,
    names: dict[str, str],  # of the identifiers that are used
    marks: dict[str, str | None],  # styles of the parts, by their identifiers
) -> None:
    """Take namespaces, needless parts and digits off; identifiers that are used have their names on the page."""
    node.tag = node.tag.rpartition("}")[2]
    if node.tag == "use" and node.get("style") in {
        marks[value[1:]] for value in node.attrib.values() if value[1:] in marks
    }:
        # a mark has the style of the part that it repeats
        del node.attrib["style"]
    for name, value in list(node.attrib.items()):
        del node.attrib[name]
        plain = name.rpartition("}")[2]
        if plain == "id":
            if value in names:
                node.set("id", names[value])
        elif plain == "href":
            node.set("href", f"#{names[value[1:]]}" if value.startswith("#") else value)
        elif value.startswith("rotate(-0 "):
            continue
        elif plain in ("d", "x", "y", "transform", "style", "width", "height", "clip-path"):
            short = NUMBER.sub(lambda found: f"{float(found[0]):.2f}".rstrip("0").rstrip("."), value)
            text = IDENTIFIER.sub(lambda found: f"url(#{names[found[1]]})", FONT.sub("", " ".join(short.split())))
            node.set(plain, AROUND[plain == "style"].sub(r"\1", text) if plain in ("d", "style") else text)
        elif plain not in ("space", "type"):
            node.set(plain, value)
    children = [child for child in node if child.tag.rpartition("}")[2] not in LEFT_OUT]
    del node[:]
    for child in children:
        _clean(child, names, marks)
        # a group that says nothing
        node.extend(child if child.tag == "g" and not child.attrib else [child])
    node.text, node.tail = (text if text and text.strip() else None for text in (node.text, node.tail))
    styles = {child.get("style") for child in node}
    if len(node) > 1 and len(styles) == 1 and all(child.tag == "use" for child in node):
        # of many marks alike the style stands once
        for child in node:
            child.attrib.pop("style", None)
        node.set("style", styles.pop() or "")

"""A figure of matplotlib as an element of a page: SVG that asks for nothing, and the same bits twice."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from typing import Any

from femimpact.app.report.markup import Element, element, sound_text
from femimpact.figures.drawing import figure_of, svg_text

FONT = re.compile(r"font-family: [^;]*(; |$)")
"""Names of fonts, for which those of the page's style stand."""

NUMBER = re.compile(r"-?\d+\.\d+")

IDENTIFIER = re.compile(r"url\(#([^)]+)\)")

LEFT_OUT = ("metadata", "style", "title")
"""Elements that matplotlib writes and a page has no use for: its style would hold for the whole page."""


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
    used = set(IDENTIFIER.findall(" ".join(value for node in root.iter() for value in node.attrib.values())))
    used |= {value[1:] for node in root.iter() for name, value in node.attrib.items() if name.endswith("href")}
    _clean(root, key, used)
    # the width of the page decides how large it is, up to the size that it is drawn for
    width = root.attrib.pop("width").removesuffix("pt")
    for name in ("height", "version"):
        root.attrib.pop(name, None)
    style = f"max-width:{float(width):g}pt;stroke-linejoin:round;stroke-linecap:butt"
    root.attrib.update({"role": "img", "aria-label": sound_text(title), "style": style})
    return root


def _clean(node: Element, key: str, used: set[str]) -> None:
    """Take namespaces, needless parts and digits off; identifiers that are used begin with the key."""
    node.tag = node.tag.rpartition("}")[2]
    for name, value in list(node.attrib.items()):
        del node.attrib[name]
        plain = name.rpartition("}")[2]
        if plain == "id":
            if value in used:
                node.set("id", f"{key}-{value}")
        elif plain == "href":
            node.set("href", f"#{key}-{value[1:]}" if value.startswith("#") else value)
        elif value.startswith("rotate(-0 "):
            continue
        elif plain in ("d", "x", "y", "transform", "style", "width", "height", "clip-path"):
            short = NUMBER.sub(lambda found: f"{float(found[0]):.2f}".rstrip("0").rstrip("."), value)
            node.set(plain, IDENTIFIER.sub(rf"url(#{key}-\1)", FONT.sub("", " ".join(short.split()))))
        elif plain not in ("space", "type"):
            node.set(plain, value)
    children = [child for child in node if child.tag.rpartition("}")[2] not in LEFT_OUT]
    del node[:]
    for child in children:
        _clean(child, key, used)
        # a group that says nothing
        node.extend(child if child.tag == "g" and not child.attrib else [child])
    node.text, node.tail = (text if text and text.strip() else None for text in (node.text, node.tail))
    styles = {child.get("style") for child in node}
    if len(node) > 1 and len(styles) == 1 and all(child.tag == "use" for child in node):
        # of many marks alike the style stands once
        for child in node:
            child.attrib.pop("style", None)
        node.set("style", styles.pop() or "")

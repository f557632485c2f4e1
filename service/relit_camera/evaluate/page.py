"""A report as one HTML file: pictures embedded, nothing loaded from anywhere."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

from relit_camera import __version__
from relit_camera.space.images import DisplayImage
from relit_camera.space.picture_files import encode_display

_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;max-width:1080px;margin:2em auto;padding:0 1em}
h1{font-size:1.6em}h2{font-size:1.25em;margin-top:2em;border-top:1px solid #ddd;padding-top:1em}
figure{margin:1.2em 0}figure img{max-width:100%;display:block}
figcaption{color:#444;font-size:.92em;max-width:62em;padding:.4em 0}
table{border-collapse:collapse;font-size:.92em}
td,th{padding:.3em .7em;border-bottom:1px solid #e3e3e3;text-align:right}
td:first-child,th:first-child{text-align:left}
svg{font:12px system-ui,sans-serif;max-width:100%}.legend span{margin-right:1.2em}
.scroll{overflow-x:auto}
"""


def picture(image: DisplayImage, caption: str, *, exact: bool = True) -> str:
    """A figure of a uint8 sRGB picture: as PNG, or as a good JPEG where it need not be `exact`."""
    suffix = ".png" if exact else ".jpg"
    data = b64encode(encode_display(image, suffix, 93)).decode()
    kind = "png" if exact else "jpeg"
    return _figure(f'<img alt="" src="data:image/{kind};base64,{data}">', caption)


def chart(svg: str, caption: str) -> str:
    """A figure of an inline SVG."""
    return _figure(svg, caption)


def _figure(content: str, caption: str) -> str:
    return f"<figure>{content}<figcaption>{escape(caption)}</figcaption></figure>"


def table(head: Sequence[str], rows: Sequence[Sequence[object]], caption: str, digits: int = 2) -> str:
    """A table; the first column holds names, numbers have so many digits after the point."""

    def cell(value: object) -> str:
        return f"{value:.{digits}f}" if isinstance(value, float) else escape(str(value))

    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join("<tr>" + "".join(f"<td>{cell(value)}</td>" for value in row) + "</tr>" for row in rows)
    return _figure(
        f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>', caption
    )


def heading(text: str) -> str:
    """Begin a section."""
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def page(title: str, blocks: Iterable[str]) -> str:
    """The whole document."""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head>'
        f"<body><h1>{escape(title)}</h1>{''.join(blocks)}<p>Made by relit-camera {__version__}.</p></body></html>\n"
    )

"""What OpenGL the display offers, asked of Qt in some milliseconds, before any window shows."""

from __future__ import annotations

import ctypes

from qtpy.QtGui import QGuiApplication, QOffscreenSurface, QOpenGLContext, QSurfaceFormat

__all__ = ["is_software", "opengl_format", "renderer_name"]

_GL_RENDERER = 0x1F01
_WITHOUT = ("offscreen", "minimal", "linuxfb")
"""Platforms of Qt on which it has no widgets of OpenGL."""

_SOFTWARE = (
    *("llvmpipe", "softpipe", "swrast", "software", "swiftshader", "basic render", "gdi generic"),
    "openswr",
)
"""Parts of the names of renderers without a graphics card. Not ``LLVM``: drivers of real ones carry it."""


def renderer_name() -> str | None:
    """Return the name of the renderer that a widget would get, or None: ``llvmpipe (LLVM 15)``.

    Qt is asked, not VTK, which may come to another device.
    """
    if QGuiApplication.instance() is None or QGuiApplication.platformName() in _WITHOUT:
        return None
    form = opengl_format()
    surface, context = QOffscreenSurface(), QOpenGLContext()
    surface.setFormat(form)
    context.setFormat(form)
    surface.create()
    if not (surface.isValid() and context.create() and context.makeCurrent(surface)):
        return None
    try:
        return _name(context)
    finally:
        context.doneCurrent()
        surface.destroy()


def is_software(name: str | None) -> bool:
    """Whether a renderer draws without a graphics card, or there is none."""
    return name is None or any(part in name.lower() for part in _SOFTWARE)


def opengl_format() -> QSurfaceFormat:
    """Return the version of OpenGL that VTK needs: 3.2, of the desktop."""
    form = QSurfaceFormat()
    form.setVersion(3, 2)
    form.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    form.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    return form


def _name(context: QOpenGLContext) -> str | None:
    """Ask OpenGL itself: not every binding of Qt has its functions."""
    address = context.getProcAddress(b"glGetString")
    if address is None or int(address) == 0:
        return None
    ask = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(int(address))
    name = ask(_GL_RENDERER)
    return None if name is None else name.decode("utf-8", "replace")

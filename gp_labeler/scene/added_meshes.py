"""Datasets of pyvista that a user draws with the bone: `Scene3D.add_mesh`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.vtkRenderingCore import vtkProp3D

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.scene.render_layers import RenderLayers, release

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["AddedMeshActors"]

_QUICK_CELLS = 100_000
"""A larger dataset is left out while the camera moves, as the bone is replaced by a preview."""


class AddedMeshActors:
    """Draws any pyvista dataset in the picture of the bone, so that each hides the other.

    Parameters
    ----------
    layers : RenderLayers
        Where to draw.
    """

    def __init__(self, layers: RenderLayers) -> None:
        self._layers = layers
        self._actors: dict[str, Any] = {}
        self._version = 0

    def add(self, dataset: Any, name: str, options: dict[str, Any]) -> pv.Actor:
        """Draw a dataset with the options of `pyvista.Plotter.add_mesh`, in place of one of the same name.

        Raises
        ------
        GpError
            pyvista cannot draw it, or not with these options.
        """
        actor: pv.Actor = _actor(dataset, options)
        self.remove(name)
        actor.SetPickable(False)
        actor.SetVisibility(False)  # it is shown for the moment in which it is drawn
        self._layers.bone.AddActor(actor)
        self._actors[name] = actor
        self._version += 1
        return actor

    def remove(self, name: str) -> bool:
        """Take a dataset away; return whether it was there."""
        actor = self._actors.pop(name, None)
        if actor is None:
            return False
        release(self._layers.bone, actor)
        self._version += 1
        return True

    @property
    def names(self) -> tuple[str, ...]:
        """Of what is drawn, in the order in which it was added."""
        return tuple(self._actors)

    @property
    def look(self) -> tuple[object, ...]:
        """Everything on which it depends how they look."""
        return self._version, *(actor.GetProperty().GetMTime() for actor in self._actors.values())

    @property
    def bounds(self) -> FloatArray | None:
        """(2, 3) lowest and highest coordinates, mm; None where nothing is drawn."""
        boxes = [np.array(actor.GetBounds()).reshape(3, 2).T for actor in self._actors.values()]
        boxes = [box for box in boxes if (box[0] <= box[1]).all()]
        if not boxes:
            return None
        return np.stack([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])

    def actors(self, *, solid: bool, quick: bool = False) -> list[vtkProp3D]:
        """Return what draws them, invisible yet.

        Parameters
        ----------
        solid : bool
            Those without transparency, drawn before the bone; else the others, drawn after it.
        quick : bool
            Those only that are drawn in a moment.
        """
        return [
            actor
            for actor in self._actors.values()
            if bool(actor.HasTranslucentPolygonalGeometry()) is not solid
            and not (quick and _n_cells(actor) > _QUICK_CELLS)
        ]

    def close(self) -> None:
        """Let go of all."""
        for name in self.names:
            self.remove(name)


def _actor(dataset: Any, options: dict[str, Any]) -> Any:
    """Let pyvista make the actor that its plotters would draw."""
    import pyvista as pv  # takes 0.6 s: not before something is added

    class Maker(pv.BasePlotter):
        """A plotter without a window."""

    maker = Maker()
    try:
        return maker.add_mesh(dataset, **{"show_scalar_bar": False, "render": False, **options})
    except Exception as error:  # of whatever kind pyvista raises
        words = str(error.args[0]) if error.args else type(error).__name__
        raise GpError(
            f"the mesh cannot be drawn: {words.splitlines()[0]}",
            remedy="Its options are those of pyvista.Plotter.add_mesh.",
        ) from error
    finally:
        maker.close()


def _n_cells(actor: Any) -> int:
    data = actor.GetMapper().GetInputDataObject(0, 0)
    return int(data.GetNumberOfElements(1))  # 1: cells

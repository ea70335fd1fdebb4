"""All steps that a script can take, by what they do."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from gp_labeler.scripting.step import Step
from gp_labeler.scripting.steps.atlas import Check, Fit, Reliability, UseAtlas
from gp_labeler.scripting.steps.expecting import Expect
from gp_labeler.scripting.steps.files import AddMesh, Details, Export, Import, Reference, RemoveMesh, Save
from gp_labeler.scripting.steps.first_labels import CheckLabelledScans, CheckPages, SuggestLike
from gp_labeler.scripting.steps.head import StraightenHead, TurnHead
from gp_labeler.scripting.steps.labellings import LabelAgain, Observer, OpenOther
from gp_labeler.scripting.steps.looking import Act, Look, PressKey, Screenshot, Undo
from gp_labeler.scripting.steps.measuring import (
    Distances,
    ExportMeasurements,
    ImportMeasurements,
    Measure,
    ShowDistance,
)
from gp_labeler.scripting.steps.placing import Choose, Confirm, Drag, Place, Put, Suggest
from gp_labeler.scripting.steps.pose import CarryPath, EstimateStep, Overlay, ReportStep, VerdictStep
from gp_labeler.scripting.steps.scan import Mesh, Open, Spacing, Threshold
from gp_labeler.scripting.steps.specimens import ContactSheet, ListFolders
from gp_labeler.scripting.steps.touching import Register, Skull, Touches

__all__ = ["STEPS"]

_ALL: tuple[type[Step], ...] = (
    *(Open, Spacing, Threshold, Mesh, Look, Choose, Place, Suggest, Confirm, Put, Drag, PressKey, Act, Undo),
    *(
        Details,
        StraightenHead,
        TurnHead,
        SuggestLike,
        CheckPages,
        CheckLabelledScans,
        Observer,
        LabelAgain,
        OpenOther,
        Import,
        Reference,
        AddMesh,
        RemoveMesh,
        Export,
        Fit,
        UseAtlas,
        Reliability,
        ListFolders,
        ContactSheet,
        Touches,
        Skull,
        Register,
        EstimateStep,
        Overlay,
    ),
    *(VerdictStep, ReportStep, CarryPath, Check, Screenshot, Save, Expect),
    *(Measure, ImportMeasurements, ExportMeasurements, ShowDistance, Distances),
)

STEPS: Mapping[str, type[Step]] = MappingProxyType({kind.do: kind for kind in _ALL})

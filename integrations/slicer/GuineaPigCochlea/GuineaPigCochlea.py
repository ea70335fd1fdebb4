"""A scripted module of 3D Slicer: the pose of a guinea-pig cochlea from touches in a markups node.

What it computes is in `GuineaPigCochleaLogic`, plain Python on plain data, which gp-labeler's tests run. What
is here talks to Slicer, is as small as it can be, and **was not run in Slicer**.
"""

from GuineaPigCochleaLogic import check_labels, estimate, expected_features

try:
    import qt
    import slicer
    import vtk
    from slicer.ScriptedLoadableModule import ScriptedLoadableModule, ScriptedLoadableModuleWidget
except ImportError:  # outside of Slicer only the logic is of use
    slicer = None


def points_of(node):
    """Return the named points of a markups node, mm, LPS."""
    points = {}
    for i in range(node.GetNumberOfControlPoints()):
        if node.GetNthControlPointPositionStatus(i) == slicer.vtkMRMLMarkupsNode.PositionDefined:
            x, y, z = node.GetNthControlPointPositionWorld(i)
            points[node.GetNthControlPointLabel(i)] = (-x, -y, z)  # Slicer's world is RAS
    return points


def add_points(name, points):
    """Add a markups node with named points, mm, LPS."""
    node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode", name)
    for label, (x, y, z) in points.items():
        node.AddControlPointWorld(vtk.vtkVector3d(-x, -y, z), label)
    return node


def add_transform(name, matrix_ras):
    """Add a linear transform node with a (4, 4) matrix, RAS."""
    matrix = vtk.vtkMatrix4x4()
    for i in range(4):
        for j in range(4):
            matrix.SetElement(i, j, matrix_ras[i][j])
    node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLLinearTransformNode", name)
    node.SetMatrixTransformToParent(matrix)
    return node


if slicer is not None:

    class GuineaPigCochlea(ScriptedLoadableModule):
        """What Slicer shows of the module."""

        def __init__(self, parent):
            ScriptedLoadableModule.__init__(self, parent)
            parent.title = "Guinea-pig cochlea"
            parent.categories = ["IGT"]
            parent.contributors = ["gp-labeler developers"]
            parent.helpText = "Estimates the pose of a cochlea from touched features, without a CT."

    class GuineaPigCochleaWidget(ScriptedLoadableModuleWidget):
        """A node, a side, and three buttons."""

        def setup(self):
            """Make the widgets."""
            ScriptedLoadableModuleWidget.setup(self)
            form = qt.QFormLayout()
            self.layout.addLayout(form)
            self.node = slicer.qMRMLNodeComboBox()
            self.node.nodeTypes = ["vtkMRMLMarkupsFiducialNode"]
            self.node.setMRMLScene(slicer.mrmlScene)
            self.side = qt.QComboBox()
            self.side.addItems(["L", "R"])
            form.addRow("Points", self.node)
            form.addRow("Side", self.side)
            self.told = qt.QLabel()
            self.told.wordWrap = True
            for title, work in (
                ("Estimate the cochlea", self.estimate),
                ("Expected features", self.expect),
                ("Check labels", self.check),
            ):
                button = qt.QPushButton(title)
                button.connect("clicked()", lambda work=work: self.say(work))
                self.layout.addWidget(button)
            self.layout.addWidget(self.told)
            self.layout.addStretch(1)

        def say(self, work):
            """Do it, and show what it says."""
            try:
                self.told.text = work()
            except Exception as error:  # GpError is one line that names the remedy
                self.told.text = str(error)

        def estimate(self):
            """Add the pose as a transform and as points."""
            found = estimate(points_of(self.node.currentNode()), self.side.currentText)
            add_transform("Cochlea", found["transform_ras"])
            add_points("Cochlea points", found["points"])
            return found["text"]

        def expect(self):
            """Add the features that are not placed where the atlas expects them."""
            found = expected_features(points_of(self.node.currentNode()), self.side.currentText)
            add_points("Expected", {code: each["position"] for code, each in found.items()})
            return f"{len(found)} features"

        def check(self):
            """Say which labels may be wrong."""
            found = check_labels(points_of(self.node.currentNode()), self.side.currentText)
            return "\n".join(found) or "No label is doubtful"

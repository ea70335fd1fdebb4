"""Drawing: one adapter per drawn thing, in 3D with VTK and on slices with numpy; knows no Qt."""

"""Small heads that are quick to register: bony lumps in tissue, without symmetry, each a little deformed."""

import json

import numpy as np

from gp_labeler.imaging.volume import Volume

LUMPS = np.array(
    [[0, 0, 0], [13, 2, 3], [-9, 9, 2], [3, -12, 5], [-4, -3, 13], [6, 7, -11], [-13, -6, -5], [9, -6, 12]],
    float,
)
RADII = np.array(
    [[9, 7, 6], [4, 3, 5], [5, 4, 3], [3, 5, 4], [4, 3, 4], [5, 5, 3], [3, 4, 6], [3, 3, 3]], float
)
FEATURES = ("IN", "CA_L", "RWA_L", "OI_L", "CA_R", "RWA_R", "OI_R", "ZL_R")
OWN = ("nose", "lump 1", "lump 2", "lump 3", "lump 4", "lump 5", "lump 6", "lump 7")
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])


def small_head(seed, *, turn=None, names=FEATURES, size=54, spacing=0.9):
    """Return a volume and its landmarks by name: the tip of each lump in x."""
    rng = np.random.default_rng(seed)
    centres = LUMPS + rng.normal(0, 0.7, LUMPS.shape)
    turn = np.eye(3) if turn is None else turn
    shift = rng.normal(0, 1.5, 3)
    axes = (np.arange(size) - (size - 1) / 2) * spacing
    z, y, x = np.meshgrid(axes, axes, axes, indexing="ij")
    own = (np.stack([x, y, z], axis=-1) - shift) @ turn  # the head's own coordinates
    bone = np.zeros((size,) * 3)
    for centre, radii in zip(centres, RADII, strict=True):
        depth = 1 - np.sqrt((((own - centre) / radii) ** 2).sum(axis=-1))
        bone = np.maximum(bone, np.clip(0.5 + 3 * depth, 0, 1))
    tissue = 0.25 * (np.linalg.norm(own, axis=-1) < 23)
    grey = 1000 * np.maximum(tissue, bone) + rng.normal(0, 20, bone.shape)
    volume = Volume.from_parts(grey.astype(np.float32), [spacing] * 3, [axes[0]] * 3, name=f"small-{seed}")
    tips = centres + RADII * [1, 0, 0]
    return volume, dict(zip(names, tips @ turn.T + shift, strict=True))


def save_markups(path, points):
    """Write landmarks as 3D Slicer does, in as few words as it reads."""
    rows = [{"label": name, "position": xyz.tolist()} for name, xyz in points.items()]
    markup = {"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": rows}
    path.write_text(json.dumps({"markups": [markup]}))


def save_volume(path, volume):
    """Write a scan as NRRD."""
    import SimpleITK

    image = SimpleITK.GetImageFromArray(volume.array)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    SimpleITK.WriteImage(image, str(path))

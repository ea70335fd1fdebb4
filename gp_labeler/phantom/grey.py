"""Grey values of a phantom, 16 bit: air, soft tissue and bone stand apart in the histogram."""

AIR = 2_000.0
SOFT = 11_000.0
BRAIN = 11_600.0
FLUID = 11_300.0
THIN_MEMBRANE = 10_000.0
BONE = 33_000.0
CANCELLOUS = 27_000.0
ENAMEL = 46_000.0
DENTINE = 38_000.0
LENS = 14_500.0
SUTURE = 17_000.0

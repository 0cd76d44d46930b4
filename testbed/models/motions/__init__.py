"""The kinds of commanded motion, one file each."""

MOTIONS = {
    "chirp": "testbed.models.motions.chirp:Chirp",
    "constant": "testbed.models.motions.constant:Constant",
    "multisine": "testbed.models.motions.multisine:Multisine",
    "random": "testbed.models.motions.random:Random",
    "recorded": "testbed.models.motions.recorded:Recorded",
    "sine": "testbed.models.motions.sine:Sine",
    "static": "testbed.models.motions.static:Static",
}

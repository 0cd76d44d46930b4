"""The kinds of commanded motion, one file each."""

MOTIONS = {
    "chirp": "testbed.models.motions.chirp:Chirp",
    "constant": "testbed.models.motions.constant:Constant",
    "multisine": "testbed.models.motions.multisine:Multisine",
    "platform_psd": "testbed.models.motions.platform_psd:PlatformPsd",
    "random": "testbed.models.motions.random:Random",
    "reaction_wheel": "testbed.models.motions.reaction_wheel:ReactionWheel",
    "recorded": "testbed.models.motions.recorded:Recorded",
    "sine": "testbed.models.motions.sine:Sine",
    "static": "testbed.models.motions.static:Static",
}


def list_motions() -> list[str]:
    """Return the names of the motions that a scenario may command.

    Examples
    --------
    >>> "sine" in list_motions()
    True
    """
    return sorted(MOTIONS)

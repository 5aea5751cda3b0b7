"""The on/off valves: from a command to the moment when the air at the muscle notices.

A command reaches the muscle after the pipe's delay and the switching time. What is under way is kept as the
times at which a valve toggles, so that every edge falls exactly between two substeps.
"""

import math

from pneumarm.arm.virtual.state import INLET, QUEUE
from pneumarm.kernels import inner, kernel


@inner
def switch(muscle, side, wanted, time):  # type: ignore[no-untyped-def]
    """Have the valve on ``side`` be ``wanted`` (0 or 1) from ``time`` [s] on.

    Toggles that would come later are withdrawn: a pulse shorter than the switching time never opens a valve.
    """
    count = muscle.pending[side]
    while count > 0 and muscle.toggles[side, count - 1] >= time:
        count -= 1
    if (muscle.open[side] + count) % 2 != wanted:
        if count < QUEUE:
            muscle.toggles[side, count] = time
            count += 1
        else:
            count -= 1  # faster than any valve can follow: withdrawing the last toggle has the same effect
    muscle.pending[side] = count


@kernel
def command(body, shares, period):  # type: ignore[no-untyped-def]
    """Open valves for ``shares`` (joints, 2) of the ``period`` [s]: -1 to +1, with +-1 until the next command.

    Returns False, with nothing set, if one of them is something else.
    """
    for j in range(len(body.joints)):
        for m in range(2):
            if not -1 <= shares[j, m] <= 1:
                return False
    now, c = body.surroundings[0].time, body.constants.surroundings[0]
    opened, closed = now + c.opening_delay, now + c.closing_delay
    for j in range(len(body.joints)):
        for m in range(2):
            muscle, share = body.muscles[j, m], shares[j, m]
            for side in range(2):
                wanted = share if side == INLET else -share
                switch(muscle, side, 1 if wanted > 0 else 0, opened if wanted > 0 else closed)
                if 0 < wanted < 1:
                    switch(muscle, side, 0, closed + wanted * period)
    return True


@kernel
def command_sides(body, until):  # type: ignore[no-untyped-def]
    """Open inlets and outlets ``until`` a time (joints, 2, 2) [s], or not at all: what faults make of a command."""
    now, c = body.surroundings[0].time, body.constants.surroundings[0]
    for j in range(len(body.joints)):
        for m in range(2):
            for side in range(2):
                wanted = until[j, m, side] > now
                switch(body.muscles[j, m], side, int(wanted), now + (c.opening_delay if wanted else c.closing_delay))
                if wanted and until[j, m, side] < math.inf:
                    switch(body.muscles[j, m], side, 0, until[j, m, side] + c.closing_delay)


@inner
def toggle_due(muscle, now):  # type: ignore[no-untyped-def]
    """Toggle the valves whose time has come, and return the time of the next toggle [s] (inf if none)."""
    following = math.inf
    for side in range(2):
        count = muscle.pending[side]
        while count > 0 and muscle.toggles[side, 0] <= now:
            muscle.open[side] = 1 - muscle.open[side]
            count -= 1
            for i in range(count):
                muscle.toggles[side, i] = muscle.toggles[side, i + 1]
        muscle.pending[side] = count
        if count > 0:
            following = min(following, muscle.toggles[side, 0])
    return following

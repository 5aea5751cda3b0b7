"""Parts of compiled loops that write movements into their record, action by action."""

from pneumarm.kernels import inner, part
from pneumarm.task.environment import angle, velocity
from pneumarm.task.fleet import one
from pneumarm.task.reward import paid


@part
def note_begin(task, episode, record, e):  # type: ignore[no-untyped-def]
    """Write where ``episode`` begins and its goal as movement ``e`` of ``record``."""
    for joint in range(episode.goal.shape[0]):
        record.goal[e, joint] = episode.goal[joint]
        record.angle_begin[e, joint] = angle(task, episode, joint)


@part
def note_action(reward, switched, is_reached, record, e):  # type: ignore[no-untyped-def]
    """Count an action of movement ``e``, whose joints ``switched`` (joints,), and what is paid for it."""
    switches = 0
    for joint in range(switched.shape[0]):
        record.switches[e, joint] += switched[joint]
        switches += switched[joint]
    record.actions[e] += 1
    record.reward[e] += paid(reward, is_reached, switches)


@part
def note_end(task, episode, is_reached, record, e):  # type: ignore[no-untyped-def]
    """Write where ``episode`` is now as the end of movement ``e``."""
    record.success[e] = is_reached
    for joint in range(episode.goal.shape[0]):
        record.angle_end[e, joint] = angle(task, episode, joint)
        record.velocity_end[e, joint] = velocity(task, episode, joint)


@part
def goes_on(task, is_reached, record, e):  # type: ignore[no-untyped-def]
    """Return whether movement ``e`` goes on: its goal is not reached and it is not cut off."""
    return not is_reached and record.actions[e] < task.cutoff


@inner
def note_alive(task, fleet, alive, is_reached, record, first):  # type: ignore[no-untyped-def]
    """Note what each arm of ``fleet`` that is ``alive`` (n,) did, as movement ``first`` + e; return how many ended.

    Those whose movement ended, which ``is_reached`` (n,) and the cut-off decide, are no longer alive.
    """
    ended = 0
    for e in range(alive.shape[0]):
        if not alive[e]:
            continue
        note_action(task.reward, fleet.switched[e], is_reached[e], record, first + e)
        if not goes_on(task, is_reached[e], record, first + e):
            note_end(task, one(fleet, e), is_reached[e], record, first + e)
            alive[e] = False
            ended += 1
    return ended

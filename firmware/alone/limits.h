/* What protects an arm from its own controller, turn by turn: the rules of the host's guard (arm/guard.py).
 *
 * The latches below stay in force whatever this says. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "converter.h"

/* Forget what was before. */
void limits_start(void);

/* Return whether the angle of joint 1 can be believed, where it is `wanted` [counts]: a dead sensor reads the end of its
 * range. */
bool limits_believe(const struct sample *sample, int16_t wanted);

/* Close what may not open of `codes` (joint 1: four bits), each open for `lengths` [PULSE_UNIT_US] of a `period`. */
uint8_t limits_keep(const struct sample *sample, uint8_t codes, const uint16_t lengths[2], uint16_t period);

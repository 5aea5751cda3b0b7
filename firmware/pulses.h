/* Pulses: for how long a valve is to be open, timed by the board. It knows when which muscles are due, no valves. */
#pragma once
#include <stdint.h>

#include "protocol.h"

/* Forget what was timed, and take up for how long each muscle of the bit mask `muscles` is to be open [PULSE_UNIT_US]. */
void pulses_prepare(uint8_t muscles, const uint16_t open[MUSCLES]);

/* Begin to time what was prepared. Interrupts off. */
void pulses_start(void);

/* Forget what is timed. */
void pulses_forget(void);

/* Return the code bits of the muscles whose time is over since the last call: in TIMER0_COMPA, and only there. */
uint8_t pulses_ended(void);

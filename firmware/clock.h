/* Time since the start of the program, and a tick a millisecond. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

void clock_start(void);

/* Return the time [us]; it wraps after 71.6 minutes. */
uint32_t clock_microseconds(void);

/* Return the time [PULSE_UNIT_US]; it wraps after 65,536 of them. Interrupts off. */
uint16_t clock_units(void);

/* Count a millisecond; the tick's interrupt calls this first. */
void clock_tick(void);

/* Return whether a tick came since the last call. */
bool clock_ticked(void);

/* What lets the valves follow the host, and what takes that away: armed or not, the latches, the dead-man.
 *
 * The only place that sets valves. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Return the flags ARMED, DEAD_MAN, CONVERTER and OVER_PRESSURE_n. */
uint16_t latches_flags(void);

/* Return whether the arm is armed. */
bool latches_armed(void);

/* Clear the latches and close all valves; return false where the cause of a latch remains. */
bool latches_arm(void);

/* Vent all muscles; latches stay. */
void latches_disarm(void);

/* Set the valves, but for muscles that a latch vents, and feed the dead-man; return false where not armed. The valves
 * of the muscles of the bit mask `pulses` close when they have been open for their `open` [PULSE_UNIT_US]. */
bool latches_valves(uint8_t codes, uint8_t pulses, const uint16_t open[MUSCLES]);

/* Feed the dead-man and leave the valves alone; return false where not armed. */
bool latches_feed(void);

/* Close the valves whose pulses have ended: in TIMER0_COMPA, and only there. */
void latches_end_pulses(void);

/* Vent a muscle and keep it vented; called by the converter's interrupt. */
void latch_over_pressure(uint8_t muscle);

/* Look after the dead-man, the converter and the light: once a millisecond, interrupts off. */
void latches_tick(void);

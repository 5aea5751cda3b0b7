/* The eight valves. All outputs off is vented: inlets are normally closed, exhausts normally open.
 *
 * Codes are two bits a muscle, as on the line: see PROTOCOL.md. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* The codes of all muscles vented, which is also all outputs off. */
#define ALL_OUT 0xaa

/* Make the pins outputs, all of them off. */
void valves_start(void);

/* Return whether each muscle's code is a known one. */
bool valves_known(uint8_t codes);

/* Set all valves at once, in an order in which no inlet is open together with its exhaust.
 * Call it with interrupts off: an over-pressure must not vent in the middle of it. */
void valves_set(uint8_t codes);

/* Return the codes as applied. */
uint8_t valves_applied(void);

/* Switch the light on D13. */
void light_set(bool on);

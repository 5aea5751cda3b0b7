/* Why the program started, how often it has, and the watchdog that starts it again. */
#pragma once
#include <stdint.h>

/* Return the reset causes of PROTOCOL.md, a bit each; 0 where a boot loader kept them to itself. */
uint8_t reset_cause(void);

/* Count this start in the EEPROM; call it once. */
void reset_count(void);

/* Return the starts counted, this one included, since the EEPROM was erased. */
uint16_t reset_boots(void);

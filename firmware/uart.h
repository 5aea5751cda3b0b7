/* The serial line, 8N1, with a ring of bytes in each direction, filled and emptied by interrupts. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

/* Take a byte that waits in the line's register, if one does; interrupts off. */
void uart_take(void);

/* Take the oldest byte received; return false where there is none. */
bool uart_receive(uint8_t *byte);

/* Return whether a whole frame can be sent now without waiting. */
bool uart_has_room(void);

/* Send bytes; a frame only where uart_has_room(). */
void uart_send(const uint8_t *bytes, uint8_t length);

/* Return whether bytes were lost since the last call. */
bool uart_overrun(void);

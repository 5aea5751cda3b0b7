/* Lines that a person types, and what the board answers: see README.md. */
#pragma once
#include <stdint.h>

/* Take in a byte; at the end of a line do what it says, and answer. */
void lines_byte(uint8_t byte);

/* Say that the program has begun. */
void lines_start(void);

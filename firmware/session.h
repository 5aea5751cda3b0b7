/* Requests and their replies: which one is fresh, what it does, what is answered. */
#pragma once
#include <stdint.h>

/* Begin to talk: end whatever reply a reset broke off, so that the next one is not taken for its rest. */
void session_start(void);

/* Take one byte off the line; a request that it completes is answered. */
void session_byte(uint8_t byte);

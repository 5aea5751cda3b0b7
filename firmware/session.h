/* Requests and their replies: which one is fresh, what it does, what is answered. */
#pragma once
#include <stdint.h>

/* Take one byte off the line; a request that it completes is answered. */
void session_byte(uint8_t byte);

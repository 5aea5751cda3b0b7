/* The analog-to-digital converter: all channels in turn, without end, in its interrupt. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

#define CHANNELS (JOINTS * 3 + EXTRAS)

/* All sensors at one moment, [counts]. */
struct sample {
	uint32_t time; /* [us] */
	uint16_t angle[JOINTS];
	uint16_t pressure[MUSCLES];
	int16_t velocity[JOINTS]; /* [counts/ms / VELOCITY_SCALE] */
	uint16_t extra[EXTRAS];
};

/* Begin to convert; also begins again where the converter has stopped. */
void converter_start(void);

/* Set of how many conversions a median is taken, the length of the velocity's average [ms], the limits [counts]. */
void converter_configure(uint8_t conversions, uint8_t velocity_ms, const uint16_t limits[MUSCLES]);

/* Return all sensors as they are now. */
void converter_read(struct sample *sample);

/* Keep the medians of the angles for the velocity: once a millisecond. */
void converter_tick(void);

/* Return the number of sweeps over all channels, modulo 256: a converter that works makes four a millisecond. */
uint8_t converter_sweeps(void);

/* Return whether the last conversion of any muscle's pressure was over its limit. */
bool converter_over(void);

#include "limits.h"

#include "control.h"
#include "protocol.h"

/* Readings in a row at an end of the converter's range after which the sensor is taken to be gone. */
#define DEAD_READINGS 3
#define HIGHEST 1023
/* A muscle recovers from inflation so many times faster by venting than by resting. */
#define VENTING 10

static uint8_t dead;
static int32_t inflated[2]; /* for how long inlets count as open [PULSE_UNIT_US] */
static bool spent[2];

void limits_start(void)
{
	dead = 0;
	for (uint8_t i = 0; i < 2; i++) {
		inflated[i] = 0;
		spent[i] = false;
	}
}

bool limits_believe(const struct sample *sample)
{
	if (sample->angle[0] > 0 && sample->angle[0] < HIGHEST)
		dead = 0;
	else if (dead < DEAD_READINGS)
		dead++;
	return dead < DEAD_READINGS;
}

static uint8_t keep(uint8_t i, uint16_t pressure, uint8_t code, uint16_t length, uint16_t period)
{
	if (code == IN && (pressure > control_most_pressure() || spent[i]))
		code = CLOSED;
	if (code == IN)
		inflated[i] += length;
	else
		inflated[i] -= code == OUT ? (int32_t)VENTING * length : period;
	if (inflated[i] < 0)
		inflated[i] = 0;
	spent[i] = spent[i] ? inflated[i] > 0 : inflated[i] >= control_most_inflation();
	return code;
}

uint8_t limits_keep(const struct sample *sample, uint8_t codes, const uint16_t lengths[2], uint16_t period)
{
	uint8_t kept = 0;
	for (uint8_t i = 0; i < 2; i++)
		kept |= keep(i, sample->pressure[i], codes >> 2 * i & 3, lengths[i], period) << 2 * i;
	return kept;
}

#include "limits.h"

#include "control.h"
#include "protocol.h"

/* Decisions in a row at an end of the converter's range after which the angle's sensor is taken to be gone: where it
 * got there by a leap that no joint makes in a period, and where it stays there although it is wanted elsewhere. */
#define AFTER_A_LEAP 3
#define AFTER_NONE 60
#define LEAP 200
#define ELSEWHERE 100
#define HIGHEST 1023
/* A muscle recovers from inflation so many times faster by venting than by resting. */
#define VENTING 10

static uint8_t at_end, elsewhere;
static bool leapt;
static int16_t before;
static int32_t inflated[2]; /* for how long inlets count as open [PULSE_UNIT_US] */
static bool spent[2];

void limits_start(void)
{
	at_end = elsewhere = 0;
	before = -1;
	for (uint8_t i = 0; i < 2; i++) {
		inflated[i] = 0;
		spent[i] = false;
	}
}

static uint16_t apart(int16_t a, int16_t b)
{
	return a > b ? a - b : b - a;
}

bool limits_believe(const struct sample *sample, int16_t wanted)
{
	int16_t angle = sample->angle[0];
	if (angle > 0 && angle < HIGHEST) {
		at_end = elsewhere = 0;
		before = angle;
		return true;
	}
	if (at_end == 0)
		leapt = before >= 0 && apart(angle, before) > LEAP;
	if (at_end < AFTER_A_LEAP)
		at_end++;
	elsewhere = apart(angle, wanted) > ELSEWHERE ? elsewhere + 1 : 0;
	return !(leapt && at_end >= AFTER_A_LEAP) && elsewhere < AFTER_NONE;
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

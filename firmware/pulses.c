#include "pulses.h"

#include <avr/io.h>

#include "clock.h"
#include "valves.h"

/* Timer 0 counts 4 us. The ticks, which the dead-man hangs on, have a timer of their own. */
#define RUN (_BV(CS01) | _BV(CS00))
_Static_assert(F_CPU == 16000000 && PULSE_UNIT_US == 8, "two counts are a unit");
#define COUNTS(units) (2 * (units))
/* The timer has eight bits. What ends later [PULSE_UNIT_US] is looked at once or more on the way there. */
#define FARTHEST (UINT8_MAX / COUNTS(1))
/* From the timer's moment to the pin of a valve that closes it takes so long on average [PULSE_UNIT_US]. */
#define LEAD 4

struct end {
	uint16_t after; /* the start [PULSE_UNIT_US] */
	uint8_t codes;  /* the code bits of its muscle */
};
/* The latest first, so that the next one is the last. They are sorted before the valves open: interrupts must not be
 * off for long. */
static struct end ends[MUSCLES];
static uint8_t prepared;
static uint16_t started;      /* on the clock */
static volatile uint8_t left; /* so many of `ends` are still to come; none while they are prepared */

static void wake_never(void)
{
	TIMSK0 = 0;
}

static void wake_in(uint16_t units)
{
	TCCR0B = 0;
	TCNT0 = 0;
	OCR0A = COUNTS(units > FARTHEST ? FARTHEST : (uint8_t)units);
	TIFR0 = _BV(OCF0A);
	TIMSK0 = _BV(OCIE0A);
	TCCR0B = RUN;
}

void pulses_forget(void)
{
	left = 0;
	wake_never();
}

void pulses_prepare(uint8_t muscles, const uint16_t open[MUSCLES])
{
	pulses_forget();
	prepared = 0;
	for (uint8_t i = 0, codes = 3; i < MUSCLES; i++, codes <<= 2) {
		if (!(muscles & 1 << i))
			continue;
		uint16_t after = open[i] > LEAD ? open[i] - LEAD : 1;
		uint8_t place = prepared++;
		for (; place && ends[place - 1].after < after; place--)
			ends[place] = ends[place - 1];
		ends[place] = (struct end){after, codes};
	}
}

void pulses_start(void)
{
	if (!prepared)
		return;
	started = clock_units();
	left = prepared;
	wake_in(ends[left - 1].after);
}

uint8_t pulses_ended(void)
{
	uint8_t ended = 0;
	uint16_t since = clock_units() - started;
	while (left && ends[left - 1].after <= since)
		ended |= ends[--left].codes;
	if (left)
		wake_in(ends[left - 1].after - since);
	else
		wake_never();
	return ended;
}

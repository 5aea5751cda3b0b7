#include "clock.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "protocol.h"

/* Timer 1 counts half microseconds from 0 to TOP, then ticks. */
#define TOP 1999

/* Of these counts, the unit of pulses. */
#define UNIT (PULSE_UNIT_US * 2)
#define UNITS_A_TICK ((TOP + 1) / UNIT)
_Static_assert(UNITS_A_TICK * UNIT == TOP + 1, "a tick is a whole number of units");

static volatile uint32_t ticks_us;
static volatile uint16_t ticks_units;
static volatile bool ticked;

void clock_start(void)
{
	_Static_assert(F_CPU == 16000000, "half microseconds are eight cycles");
	TCCR1A = 0;
	OCR1A = TOP;
	TCNT1 = 0;
	TIMSK1 = _BV(OCIE1A);
	TCCR1B = _BV(WGM12) | _BV(CS11);
}

/* Return whether a tick before the count `since` waits for its interrupt, so that it is in no number yet. The count may
 * still be of the time before the tick, so that a large one says no. */
static bool ticks_unserved(uint16_t since)
{
	return (TIFR1 & _BV(OCF1A)) && since < TOP / 2;
}

uint32_t clock_microseconds(void)
{
	uint32_t before;
	uint16_t since;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		before = ticks_us;
		since = TCNT1;
		if (ticks_unserved(since))
			before += 1000;
	}
	return before + since / 2;
}

uint16_t clock_units(void)
{
	uint16_t before = ticks_units;
	uint16_t since = TCNT1;
	if (ticks_unserved(since))
		before += UNITS_A_TICK;
	return before + since / UNIT;
}

void clock_tick(void)
{
	ticks_us += 1000;
	ticks_units += UNITS_A_TICK;
	ticked = true;
}

bool clock_ticked(void)
{
	if (!ticked)
		return false;
	ticked = false;
	return true;
}

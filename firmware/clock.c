#include "clock.h"

#include <avr/io.h>
#include <util/atomic.h>

/* Timer 1 counts half microseconds from 0 to TOP, then ticks. */
#define TOP 1999

static volatile uint32_t ticks_us;
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

uint32_t clock_microseconds(void)
{
	uint32_t before;
	uint16_t since;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		before = ticks_us;
		since = TCNT1;
		/* A tick that waits for its interrupt is in no count yet. The count that was read may still be of the
		 * time before it, so that a large one is left alone. */
		if ((TIFR1 & _BV(OCF1A)) && since < TOP / 2)
			before += 1000;
	}
	return before + since / 2;
}

void clock_tick(void)
{
	ticks_us += 1000;
	ticked = true;
}

bool clock_ticked(void)
{
	if (!ticked)
		return false;
	ticked = false;
	return true;
}

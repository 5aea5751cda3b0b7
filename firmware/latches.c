#include "latches.h"

#include <util/atomic.h>

#include "converter.h"
#include "protocol.h"
#include "pulses.h"
#include "valves.h"

/* A converter without a whole sweep in this time has stopped [ms]; one takes a quarter of a millisecond. */
#define CONVERTER_MS 3
/* The light blinks with half a period of this many ticks, a power of two. */
#define BLINK 256
#define ANY_LATCH (DEAD_MAN | CONVERTER | OVER_PRESSURE_1 | OVER_PRESSURE_2 | OVER_PRESSURE_3 | OVER_PRESSURE_4)
/* The code bits of a muscle. */
static const uint8_t CODES_OF[MUSCLES] = {0x03, 0x0c, 0x30, 0xc0};

_Static_assert(DEAD_MAN_MS <= UINT8_MAX, "silence is counted in a byte");
static volatile uint16_t flags;
static volatile uint8_t latched; /* code bits of the muscles of which OVER_PRESSURE_n is set */
static volatile uint8_t silence_ms; /* since the dead-man was fed */
static volatile uint8_t still_ms;   /* since the converter made a sweep */

/* Set the valves, but for muscles that a latch vents. */
static void set(uint8_t codes)
{
	valves_set((codes & ~latched) | (ALL_OUT & latched));
}

uint16_t latches_flags(void)
{
	uint16_t now;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
		now = flags;
	return now;
}

bool latches_armed(void)
{
	return latches_flags() & ARMED;
}

bool latches_arm(void)
{
	bool gone;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		gone = still_ms < CONVERTER_MS && !converter_over();
		if (gone) {
			flags = ARMED;
			latched = 0;
			silence_ms = 0;
			pulses_forget();
			valves_set(CLOSED);
		}
	}
	return gone;
}

void latches_disarm(void)
{
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		flags &= ~ARMED;
		pulses_forget(); /* what is vented stays so */
		valves_set(ALL_OUT);
	}
}

bool latches_valves(uint8_t codes, uint8_t pulses, const uint16_t open[MUSCLES])
{
	bool armed;
	pulses_prepare(pulses, open);
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		armed = flags & ARMED;
		if (armed) {
			silence_ms = 0;
			set(codes);
			pulses_start();
		}
	}
	return armed;
}

bool latches_feed(void)
{
	bool armed;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		armed = flags & ARMED;
		if (armed)
			silence_ms = 0;
	}
	return armed;
}

void latches_end_pulses(void)
{
	uint8_t ended = pulses_ended();
	if (ended)
		set(valves_applied() & ~ended);
}

void latch_over_pressure(uint8_t muscle)
{
	flags |= OVER_PRESSURE_1 << muscle;
	latched |= CODES_OF[muscle];
	set(valves_applied());
}

static void latch_all(uint16_t flag)
{
	flags |= flag;
	latches_disarm();
}

void latches_tick(void)
{
	static uint16_t ticks;
	static uint8_t sweeps;

	/* Counted in ticks, it comes up to one early and never late. */
	if ((flags & ARMED) && ++silence_ms >= DEAD_MAN_MS)
		latch_all(DEAD_MAN);

	if (converter_sweeps() != sweeps) {
		sweeps = converter_sweeps();
		still_ms = 0;
	} else if (still_ms < CONVERTER_MS) {
		still_ms++;
	} else {
		latch_all(CONVERTER);
		converter_start(); /* a register may have been disturbed; ARM ends the latch once it runs again */
	}

	light_set(flags & ANY_LATCH ? ++ticks & BLINK : flags & ARMED);
}

#include "converter.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <string.h>
#include <util/atomic.h>

#include "clock.h"
#include "latches.h"

#ifdef FEW_CHANNELS
/* A program that converts few channels has time for them: 16 MHz / 128 = 125 kHz, 104 us a conversion. */
#define USED FEW_CHANNELS
#define RUN (_BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0))
#else
/* 16 MHz / 32 = 500 kHz: 26 us a conversion. That is faster than the 200 kHz up to which all ten bits are promised,
 * and costs less than one count; the medians take away more. */
#define USED CHANNELS
#define RUN (_BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS0))
#endif
#define REFERENCE _BV(REFS0) /* the supply, which also feeds the potentiometers: its drift cancels */

#define MOST_CONVERSIONS 9
#define NO_MUSCLE 0xff

/* PROTOCOL.md, table of pins. */
enum { ANGLE_1, PRESSURE_1, PRESSURE_2, ANGLE_2, PRESSURE_3, PRESSURE_4, EXTRA_1, EXTRA_2 };
static const uint8_t MUSCLE_OF[CHANNELS] = {NO_MUSCLE, 0, 1, NO_MUSCLE, 2, 3, NO_MUSCLE, NO_MUSCLE};
static const uint8_t ANGLE_OF[JOINTS] = {ANGLE_1, ANGLE_2};
static const uint8_t PRESSURE_OF[MUSCLES] = {PRESSURE_1, PRESSURE_2, PRESSURE_3, PRESSURE_4};
static const uint8_t EXTRA_OF[EXTRAS] = {EXTRA_1, EXTRA_2};

/* The last conversions of a channel, in the order of time and in the order of size. Kept sorted all the time: a median
 * costs nothing when it is asked for, and the reply is soon on its way. */
struct window {
	uint16_t recent[MOST_CONVERSIONS];
	uint16_t sorted[MOST_CONVERSIONS];
};
static struct window windows[CHANNELS];
static volatile uint8_t channel, sweep;
static volatile uint8_t conversions = 5;
static volatile uint8_t oldest; /* place in `recent` of all channels */
/* Windows that are still to be filled, with one value each, when the conversions begin or their number changes. */
static volatile uint8_t unfilled = USED;

static volatile uint8_t over[MUSCLES];
static volatile uint16_t limit[MUSCLES] = {0x3ff, 0x3ff, 0x3ff, 0x3ff}; /* nothing is over the highest count */

/* Medians of the angles, one a millisecond; `newest` is where the last one is. */
#define PAST (MOST_VELOCITY_MS + 1)
static volatile uint16_t past[JOINTS][PAST];
static volatile uint8_t newest;
static volatile uint8_t velocity_ms = 1;
/* So many milliseconds of them are known; before that the arm is taken to have been at rest. */
static volatile uint8_t known_ms;
static volatile bool no_past = true;

void converter_start(void)
{
	/* Gives up a conversion that never ends, and the flag of one that ended and was not fetched: its interrupt
	 * would take the conversion that begins here for that of the next channel. */
	ADCSRA = _BV(ADIF);
	ADMUX = REFERENCE | channel;
	DIDR0 = 0x3f; /* no digital inputs on the analog pins: less noise */
	ADCSRB = 0;
	ADCSRA = RUN | _BV(ADSC);
}

static void fill(struct window *window, uint16_t value)
{
	for (uint8_t i = 0; i < MOST_CONVERSIONS; i++)
		window->recent[i] = window->sorted[i] = value;
}

/* Put `value` in the place of the oldest one. */
static inline void renew(struct window *window, uint16_t value)
{
	uint16_t *replaced = &window->recent[oldest];
	uint16_t old = *replaced;
	uint16_t *place = window->sorted;
	if (value == old)
		return;
	*replaced = value;
	/* What lies between the old value and the new one moves by one place. The new one, or the old one, ends the
	 * search, so that no end has to be looked for but where the new one is the highest or the lowest. */
	if (value > old) {
		uint16_t *last = place + conversions - 1;
		while (*place != old)
			place++;
		for (; place != last && place[1] < value; place++)
			*place = place[1];
	} else {
		uint16_t *first = place;
		place += conversions - 1;
		while (*place != old)
			place--;
		for (; place != first && place[-1] > value; place--)
			*place = place[-1];
	}
	*place = value;
}

ISR(ADC_vect)
{
	uint16_t value = ADC;
	uint8_t done = channel;
	uint8_t next = done + 1 == USED ? 0 : done + 1;
	/* Each conversion is started here, not by free running: there the channel of the conversion under way is one
	 * behind the register. */
	ADMUX = REFERENCE | next;
	ADCSRA = RUN | _BV(ADSC);
	channel = next;

	if (unfilled) {
		unfilled--;
		fill(&windows[done], value);
	} else {
		renew(&windows[done], value);
	}
	if (next == 0) {
		sweep++;
		uint8_t after = oldest + 1;
		oldest = after >= conversions ? 0 : after;
	}

	/* Last, so that the interrupt has no registers to save over the call. */
	uint8_t muscle = MUSCLE_OF[done];
	if (muscle != NO_MUSCLE) {
		if (value <= limit[muscle])
			over[muscle] = 0;
		else if (over[muscle] < OVER_PRESSURE_SAMPLES && ++over[muscle] == OVER_PRESSURE_SAMPLES)
			latch_over_pressure(muscle);
	}
}

static uint16_t median(uint8_t of)
{
	uint16_t value;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
		value = windows[of].sorted[conversions / 2];
	return value;
}

void converter_tick(void)
{
	uint8_t next = newest + 1 == PAST ? 0 : newest + 1;
	for (uint8_t joint = 0; joint < JOINTS; joint++)
		past[joint][next] = median(ANGLE_OF[joint]);
	newest = next;
	/* Counted, not filled: filling takes longer than two bytes take on the line, and the third would be lost. */
	if (no_past)
		known_ms = 0;
	else if (known_ms < MOST_VELOCITY_MS)
		known_ms++;
	no_past = unfilled;
}

static int16_t velocity(uint8_t joint)
{
	uint8_t now, then, over_ms, reach;
	int16_t change;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		over_ms = velocity_ms;
		now = newest;
		reach = over_ms < known_ms ? over_ms : known_ms;
		then = now >= reach ? now - reach : now + PAST - reach;
		change = past[joint][now] - past[joint][then];
	}
	/* Unsigned in 16 bits, which the highest count times the scale just fits: the signed division of 32 bits takes
	 * longer than the whole rest of a reading. Rounded alike forwards and backwards. */
	_Static_assert(0x3ffUL * VELOCITY_SCALE + MOST_VELOCITY_MS / 2 <= UINT16_MAX, "the quotient must not wrap");
	uint16_t scaled = change < 0 ? -change : change;
	scaled = (uint16_t)(scaled * VELOCITY_SCALE + over_ms / 2) / over_ms;
	if (scaled > INT16_MAX)
		scaled = INT16_MAX;
	return change < 0 ? -(int16_t)scaled : (int16_t)scaled;
}

void converter_read(struct sample *sample)
{
	sample->time = clock_microseconds();
	for (uint8_t i = 0; i < JOINTS; i++)
		sample->angle[i] = median(ANGLE_OF[i]);
	for (uint8_t i = 0; i < MUSCLES; i++)
		sample->pressure[i] = median(PRESSURE_OF[i]);
	for (uint8_t i = 0; i < EXTRAS; i++)
		sample->extra[i] = median(EXTRA_OF[i]);
	for (uint8_t i = 0; i < JOINTS; i++)
		sample->velocity[i] = velocity(i);
}

void converter_configure(uint8_t of, uint8_t over_ms, const uint16_t limits[MUSCLES])
{
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		conversions = of;
		oldest = 0;
		unfilled = USED;
		velocity_ms = over_ms;
		known_ms = 0;
		no_past = true;
		memcpy((void *)limit, limits, sizeof limit);
		memset((void *)over, 0, sizeof over);
	}
}

uint8_t converter_sweeps(void)
{
	return sweep;
}

bool converter_over(void)
{
	for (uint8_t i = 0; i < MUSCLES; i++)
		if (over[i])
			return true;
	return false;
}

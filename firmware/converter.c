#include "converter.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <string.h>
#include <util/atomic.h>

#include "clock.h"
#include "latches.h"

/* 16 MHz / 32 = 500 kHz: 26 us a conversion. That is faster than the 200 kHz up to which all ten bits are promised,
 * and costs less than one count; the medians take away more. */
#define RUN (_BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS0))
#define REFERENCE _BV(REFS0) /* the supply, which also feeds the potentiometers: its drift cancels */

/* Sweeps that are kept: the longest median and time enough to take it while sampling goes on. A power of two. */
#define SWEEPS 16
#define MOST_CONVERSIONS 9
#define NO_MUSCLE 0xff

/* PROTOCOL.md, table of pins. */
enum { ANGLE_1, PRESSURE_1, PRESSURE_2, ANGLE_2, PRESSURE_3, PRESSURE_4, EXTRA_1, EXTRA_2 };
static const uint8_t MUSCLE_OF[CHANNELS] = {NO_MUSCLE, 0, 1, NO_MUSCLE, 2, 3, NO_MUSCLE, NO_MUSCLE};
static const uint8_t ANGLE_OF[JOINTS] = {ANGLE_1, ANGLE_2};
static const uint8_t PRESSURE_OF[MUSCLES] = {PRESSURE_1, PRESSURE_2, PRESSURE_3, PRESSURE_4};
static const uint8_t EXTRA_OF[EXTRAS] = {EXTRA_1, EXTRA_2};

static volatile uint16_t sweeps[SWEEPS][CHANNELS];
static volatile uint8_t sweep, channel;
static volatile uint8_t over[MUSCLES];
static volatile uint16_t limit[MUSCLES] = {0x3ff, 0x3ff, 0x3ff, 0x3ff}; /* nothing is over the highest count */

static volatile uint8_t conversions = 5, velocity_ms = 1;

/* Medians of the angles, one a millisecond; `newest` is where the last one is. */
#define PAST (MOST_VELOCITY_MS + 1)
static volatile uint16_t past[JOINTS][PAST];
static volatile uint8_t newest;
static volatile bool filled;

void converter_start(void)
{
	ADMUX = REFERENCE | channel;
	DIDR0 = 0x3f; /* no digital inputs on the analog pins: less noise */
	ADCSRB = 0;
	ADCSRA = RUN | _BV(ADSC);
}

ISR(ADC_vect)
{
	uint16_t value = ADC;
	uint8_t done = channel;
	uint8_t next = done + 1 == CHANNELS ? 0 : done + 1;
	/* Each conversion is started here, not by free running: there the channel of the conversion under way is one
	 * behind the register. */
	ADMUX = REFERENCE | next;
	ADCSRA = RUN | _BV(ADSC);
	channel = next;

	sweeps[sweep][done] = value;
	if (next == 0)
		sweep = (sweep + 1) & (SWEEPS - 1);

	uint8_t muscle = MUSCLE_OF[done];
	if (muscle == NO_MUSCLE)
		return;
	if (value <= limit[muscle])
		over[muscle] = 0;
	else if (over[muscle] < OVER_PRESSURE_SAMPLES && ++over[muscle] == OVER_PRESSURE_SAMPLES)
		latch_over_pressure(muscle);
}

/* Return the median of the last conversions of `of` before the sweep `end`.
 *
 * The interrupt writes to `end` and what follows it, so that these values stay for SWEEPS - MOST_CONVERSIONS sweeps,
 * 1.6 ms: nothing needs to be locked, and the channels belong together. */
static uint16_t median(uint8_t of, uint8_t end)
{
	uint16_t sorted[MOST_CONVERSIONS];
	uint8_t count = conversions;
	for (uint8_t i = 0; i < count; i++) {
		end = (end - 1) & (SWEEPS - 1);
		uint16_t value = sweeps[end][of];
		uint8_t place = i;
		for (; place && sorted[place - 1] > value; place--)
			sorted[place] = sorted[place - 1];
		sorted[place] = value;
	}
	return sorted[count / 2];
}

void converter_tick(void)
{
	uint8_t end = sweep;
	uint8_t next = newest + 1 == PAST ? 0 : newest + 1;
	for (uint8_t joint = 0; joint < JOINTS; joint++) {
		uint16_t value = median(ANGLE_OF[joint], end);
		past[joint][next] = value;
		/* Until the sweeps have come round once there is no past: the arm is taken to have been at rest. */
		if (!filled)
			for (uint8_t i = 0; i < PAST; i++)
				past[joint][i] = value;
	}
	newest = next;
	if (end >= MOST_CONVERSIONS)
		filled = true;
}

static int16_t velocity(uint8_t joint)
{
	uint8_t now, then, over_ms;
	int16_t change;
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		over_ms = velocity_ms;
		now = newest;
		then = now >= over_ms ? now - over_ms : now + PAST - over_ms;
		change = past[joint][now] - past[joint][then];
	}
	int32_t scaled = (int32_t)change * VELOCITY_SCALE;
	/* Rounded, so that it is as right forwards as backwards. */
	scaled = (scaled + (change < 0 ? -(over_ms / 2) : over_ms / 2)) / over_ms;
	return scaled > INT16_MAX ? INT16_MAX : scaled < -INT16_MAX ? -INT16_MAX : scaled;
}

void converter_read(struct sample *sample)
{
	uint8_t end = sweep;
	sample->time = clock_microseconds();
	for (uint8_t i = 0; i < JOINTS; i++)
		sample->angle[i] = median(ANGLE_OF[i], end);
	for (uint8_t i = 0; i < MUSCLES; i++)
		sample->pressure[i] = median(PRESSURE_OF[i], end);
	for (uint8_t i = 0; i < EXTRAS; i++)
		sample->extra[i] = median(EXTRA_OF[i], end);
	for (uint8_t i = 0; i < JOINTS; i++)
		sample->velocity[i] = velocity(i);
}

void converter_configure(uint8_t of, uint8_t over_ms, const uint16_t limits[MUSCLES])
{
	ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
	{
		conversions = of;
		velocity_ms = over_ms;
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

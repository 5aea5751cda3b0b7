#include "control.h"

#include "clock.h"
#include "latches.h"
#include "limits.h"
#include "protocol.h"
#include "reference.h"
#include "servo.h"
#include "valves.h"

#define PERIOD_US ((uint32_t)(SERVO_PERIOD * 1e6 + 0.5))
#define PERIOD_UNITS ((uint16_t)(SERVO_PERIOD * 1e6 / PULSE_UNIT_US + 0.5))
/* Medians of so many conversions, as the host has them. */
#define CONVERSIONS 5
#define VELOCITY_MS 1
/* The latch of over-pressure lies so much above the controller's limit: moving a closed muscle compresses it. */
#define CUT_OFF 1.5
#define NO_LIMIT 0x3ff
/* Muscles of joint 2, which is not there: without current. */
#define OTHERS (ALL_OUT & 0xf0)
#define FASTEST 250 /* hundredths of a hertz; no arm of rubber follows faster ones */
#define TURN 6.2831853f
#define SECOND_US 1000000UL

_Static_assert(SERVO_PERIOD * 1000 < DEAD_MAN_MS / 2, "the dead-man must bear a lost turn");
_Static_assert(SERVO_MOST_PRESSURE * CUT_OFF < NO_LIMIT, "the converter must see what is over the limit");

static enum control_state doing = RESTARTED;
static uint32_t next_us, heard_us;
static uint16_t took_us, longest_us, alone_seconds;

void control_start(void)
{
	uint16_t limits[MUSCLES] = {SERVO_MOST_PRESSURE * CUT_OFF, SERVO_MOST_PRESSURE * CUT_OFF, NO_LIMIT, NO_LIMIT};
	converter_configure(CONVERSIONS, VELOCITY_MS, limits);
}

static float now(void)
{
	struct sample sample;
	converter_read(&sample);
	return sample.angle[0];
}

bool control_arm(void)
{
	if (!latches_arm())
		return false;
	limits_start();
	servo_begin();
	reference_goal(now());
	longest_us = 0;
	next_us = heard_us = clock_microseconds();
	doing = DRIVING;
	return true;
}

void control_stop(enum control_state why)
{
	latches_disarm();
	doing = why;
}

enum control_state control_doing(void)
{
	return doing;
}

static float counts(float degrees)
{
	return SERVO_MIDDLE + degrees * SERVO_COUNTS_PER_DEGREE;
}

static int16_t tenths(float counts)
{
	float found = (counts - SERVO_MIDDLE) * (10 / SERVO_COUNTS_PER_DEGREE);
	return found < 0 ? found - 0.5f : found + 0.5f;
}

static bool is_goal(float counts)
{
	return counts >= SERVO_LOWEST && counts <= SERVO_HIGHEST;
}

bool control_goto(int16_t angle)
{
	float goal = counts(angle * 0.01f);
	if (!is_goal(goal))
		return false;
	reference_goal(goal);
	servo_ask();
	return true;
}

bool control_swing(int16_t frequency, int16_t amplitude)
{
	float far = amplitude * 0.01f;
	if (frequency < 1 || frequency > FASTEST || amplitude < 1 || !is_goal(counts(far)) || !is_goal(counts(-far)))
		return false;
	reference_swing(SERVO_MIDDLE, far * SERVO_COUNTS_PER_DEGREE, TURN * SERVO_PERIOD * 0.01f * frequency);
	servo_ask();
	return true;
}

void control_hold(void)
{
	reference_goal(now());
	servo_ask();
}

void control_leave_alone(uint16_t seconds)
{
	alone_seconds = seconds;
}

void control_hear(void)
{
	heard_us = clock_microseconds();
}

int16_t control_angle(void)
{
	return tenths(now());
}

int16_t control_wanted(void)
{
	return tenths(reference_now());
}

int16_t control_lowest(void)
{
	return tenths(SERVO_LOWEST);
}

int16_t control_highest(void)
{
	return tenths(SERVO_HIGHEST);
}

int16_t control_pressure(uint8_t muscle)
{
	struct sample sample;
	converter_read(&sample);
	return sample.pressure[muscle] * (100 / SERVO_COUNTS_PER_BAR) + 0.5f;
}

uint16_t control_took(void)
{
	return took_us;
}

uint16_t control_longest(void)
{
	return longest_us;
}

uint16_t control_most_pressure(void)
{
	return SERVO_MOST_PRESSURE;
}

int32_t control_most_inflation(void)
{
	return SERVO_MOST_INFLATION * 1e6 / PULSE_UNIT_US;
}

/* Open the valves for their shares of a period, within the limits. */
static void give(const struct sample *sample, const float share[2])
{
	uint16_t open[MUSCLES], lengths[2];
	uint8_t codes = 0, pulses = 0;
	for (uint8_t i = 0; i < 2; i++) {
		float size = share[i] < 0 ? -share[i] : share[i];
		lengths[i] = size * PERIOD_UNITS + 0.5f;
		if (lengths[i])
			codes |= (share[i] > 0 ? IN : OUT) << 2 * i;
	}
	codes = limits_keep(sample, codes, lengths, PERIOD_UNITS);
	for (uint8_t i = 0; i < 2; i++) {
		open[i] = lengths[i];
		/* One that lasts for the period stays open until the next decision, which may be a moment later. */
		if (lengths[i] && lengths[i] < PERIOD_UNITS && (codes >> 2 * i & 3) != CLOSED)
			pulses |= 1 << i;
	}
	latches_valves(codes | OTHERS, pulses, open);
}

static void decide(void)
{
	struct sample sample;
	float angle[1], pressure[2], path[SERVO_PATH], share[2];
	converter_read(&sample);
	if (!limits_believe(&sample, reference_now())) {
		control_stop(SENSOR);
		return;
	}
	angle[0] = sample.angle[0];
	pressure[0] = sample.pressure[0];
	pressure[1] = sample.pressure[1];
	reference_path(path, SERVO_PATH);
	servo_act(angle, pressure, path, reference_moves(), share);
	give(&sample, share);
}

void control_turn(void)
{
	if (doing != DRIVING)
		return;
	uint32_t begun = clock_microseconds();
	/* Whatever latches is the end of it: somebody has to look, and arm again. */
	if (latches_flags() != ARMED) {
		control_stop(LATCHED);
		return;
	}
	if (alone_seconds && begun - heard_us > alone_seconds * SECOND_US) {
		control_stop(LEFT_ALONE);
		return;
	}
	if ((int32_t)(begun - next_us) < 0)
		return;
	if (begun - next_us > PERIOD_US) {
		control_stop(LATE);
		return;
	}
	next_us += PERIOD_US;
	decide();
	took_us = clock_microseconds() - begun;
	if (took_us > longest_us)
		longest_us = took_us;
}

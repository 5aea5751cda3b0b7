#include "lines.h"

#include <avr/pgmspace.h>
#include <stdbool.h>

#include "control.h"
#include "protocol.h"
#include "uart.h"

/* Longest line that is understood. */
#define LONGEST 24
/* Largest number, in hundredths. */
#define MOST 32767

static char line[LONGEST + 1];
static uint8_t length;
static bool spoiled; /* by something that nobody types, or by its length */

static void say(const char *text)
{
	for (uint8_t letter; (letter = pgm_read_byte(text)); text++)
		uart_send(&letter, 1);
}

/* Say a number with `places` digits after its point. */
static void say_number(int16_t number, uint8_t places)
{
	uint8_t digits[8], count = 0;
	uint16_t size = number < 0 ? -(uint16_t)number : (uint16_t)number;
	do {
		digits[count++] = '0' + size % 10;
		size /= 10;
		if (count == places)
			digits[count++] = '.';
	} while (size || count < places + 2);
	if (number < 0)
		digits[count++] = '-';
	while (count--)
		uart_send(&digits[count], 1);
}

static void say_state(void)
{
	switch (control_doing()) {
	case DRIVING: say(PSTR("driving\n")); break;
	case RESTARTED: say(PSTR("vented since the board began: type arm\n")); break;
	case STOPPED: say(PSTR("vented: type arm\n")); break;
	case SENSOR: say(PSTR("vented: the angle reads the end of its range\n")); break;
	case LATCHED: say(PSTR("vented: too much pressure, or no measuring\n")); break;
	case LEFT_ALONE: say(PSTR("vented: nobody typed for too long\n")); break;
	case LATE: say(PSTR("vented: a decision came too late\n")); break;
	}
}

/* Take a number off `text`; return whether one is there, in hundredths. */
static bool number(const char **text, int16_t *found)
{
	const char *at = *text;
	uint16_t size = 0;
	uint8_t places = 0, digits = 0;
	bool negative = false, point = false;
	while (*at == ' ')
		at++;
	if (*at == '-') {
		negative = true;
		at++;
	}
	for (; (*at >= '0' && *at <= '9') || (*at == '.' && !point); at++) {
		if (*at == '.') {
			point = true;
			continue;
		}
		digits++;
		if (point && ++places > 2)
			continue;
		if (size > MOST / 10 - 1)
			return false;
		size = size * 10 + (*at - '0');
	}
	for (; places < 2; places++) {
		if (size > MOST / 10 - 1)
			return false;
		size *= 10;
	}
	*text = at;
	*found = negative ? -(int16_t)size : (int16_t)size;
	return digits;
}

/* Return whether the line begins with a word, and leave `rest` after it. */
static bool is(const char *word, const char **rest)
{
	const char *at = line;
	for (char letter; (letter = pgm_read_byte(word)); word++, at++)
		if (*at != letter)
			return false;
	*rest = at;
	return *at == 0 || *at == ' ';
}

static bool ends(const char *text)
{
	while (*text == ' ')
		text++;
	return *text == 0;
}

static void answer(bool done)
{
	if (done) {
		say(PSTR("ok\n"));
		return;
	}
	say(PSTR("goals are "));
	say_number(control_lowest(), 1);
	say(PSTR(" to "));
	say_number(control_highest(), 1);
	say(PSTR(" deg, swings at most 2.5 Hz\n"));
}

static void where(void)
{
	say_number(control_angle(), 1);
	say(PSTR(" deg, goal "));
	say_number(control_wanted(), 1);
	say(PSTR(", "));
	say_state();
}

static void air(void)
{
	say_number(control_pressure(0), 2);
	say(PSTR(" and "));
	say_number(control_pressure(1), 2);
	say(PSTR(" bar\n"));
}

static void turn(void)
{
	say(PSTR("decided in "));
	say_number(control_took() / 10, 2);
	say(PSTR(" ms, at most "));
	say_number(control_longest() / 10, 2);
	say(PSTR("\n"));
}

/* Do what moves the arm; return whether the line was such a one. */
static bool moves(void)
{
	const char *rest;
	int16_t first, second;
	bool goes = is(PSTR("goto"), &rest) && number(&rest, &first) && ends(rest);
	bool swings = !goes && is(PSTR("sine"), &rest) && number(&rest, &first) && number(&rest, &second) && ends(rest);
	bool holds = !goes && !swings && is(PSTR("hold"), &rest) && ends(rest);
	if (!goes && !swings && !holds)
		return false;
	if (control_doing() != DRIVING) {
		say_state();
		return true;
	}
	if (holds)
		control_hold();
	answer(goes ? control_goto(first) : swings ? control_swing(first, second) : true);
	return true;
}

static void take(void)
{
	const char *rest;
	int16_t value;
	control_hear();
	if (moves())
		return;
	if (is(PSTR("where"), &rest) && ends(rest)) {
		where();
	} else if (is(PSTR("air"), &rest) && ends(rest)) {
		air();
	} else if (is(PSTR("turn"), &rest) && ends(rest)) {
		turn();
	} else if (is(PSTR("stop"), &rest) && ends(rest)) {
		control_stop(STOPPED);
		say(PSTR("ok\n"));
	} else if (is(PSTR("arm"), &rest) && ends(rest)) {
		if (control_arm())
			say(PSTR("ok\n"));
		else
			say(PSTR("not yet: a muscle is over its limit\n"));
	} else if (is(PSTR("alone"), &rest) && number(&rest, &value) && value >= 0 && ends(rest)) {
		control_leave_alone(value / 100);
		say(PSTR("ok\n"));
	} else {
		say(PSTR("? arm goto sine hold where air stop alone turn\n"));
	}
}

void lines_byte(uint8_t byte)
{
	if (byte == '\n' || byte == '\r') {
		line[length] = 0;
		if (spoiled)
			say(PSTR("?\n"));
		else if (length)
			take();
		length = 0;
		spoiled = false;
	} else if (byte < ' ' || byte > '~' || length == LONGEST) {
		spoiled = true;
	} else {
		line[length++] = byte;
	}
}

void lines_start(void)
{
	say_state();
}

#include "reference.h"

#include <math.h>

#define TURN 6.2831853f

static float middle, amplitude, turning, phase;
static bool first; /* in its first period it was where it is */

void reference_goal(float counts)
{
	middle = counts;
	amplitude = 0;
	first = true;
}

void reference_swing(float about, float far, float step)
{
	middle = about;
	amplitude = far;
	turning = step;
	phase = 0;
	first = true;
}

bool reference_moves(void)
{
	return amplitude != 0;
}

float reference_now(void)
{
	return reference_moves() ? middle + amplitude * sinf(phase) : middle;
}

void reference_path(float *path, int length)
{
	if (!reference_moves()) {
		for (int i = 0; i < length; i++)
			path[i] = middle;
		return;
	}
	/* Two sines, and all others from these: sin(p + w) = 2 cos(w) sin(p) - sin(p - w). */
	float before = amplitude * sinf(phase - turning), now = amplitude * sinf(phase), twice = 2 * cosf(turning);
	path[0] = middle + (first ? now : before);
	for (int i = 1; i < length; i++) {
		path[i] = middle + now;
		float next = twice * now - before;
		before = now;
		now = next;
	}
	first = false;
	phase += turning;
	if (phase > TURN)
		phase -= TURN;
}

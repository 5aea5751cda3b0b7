/* What is asked for: a goal that stays, or a swing. Angles in counts, times in control periods. */
#pragma once
#include <stdbool.h>

/* Ask for a goal that stays. */
void reference_goal(float counts);

/* Ask for a swing about `middle`: so many radians further each period, beginning at its middle. */
void reference_swing(float middle, float amplitude, float turning);

/* Return whether it ever moves. */
bool reference_moves(void);

/* Return where it is now. */
float reference_now(void);

/* Write where it was a period ago, is now and will be, `length` numbers, and let a period pass. */
void reference_path(float *path, int length);

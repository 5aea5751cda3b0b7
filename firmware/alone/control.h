/* The control loop: once a period it reads, lets the controller decide, and opens valves. Nobody else has to be there. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

#include "converter.h"

/* Why the arm is vented, or that it is not. */
enum control_state { RESTARTED, DRIVING, STOPPED, SENSOR, LATCHED, LEFT_ALONE, LATE };

/* Measure, vented. */
void control_start(void);

/* Arm, and hold the joint where it is; return false where a latch's cause remains. */
bool control_arm(void);

/* Vent, and stay so until armed again; `why` is told. */
void control_stop(enum control_state why);

/* Return what it is doing. */
enum control_state control_doing(void);

/* Ask for an angle [hundredths of a degree]; return false where it is out of the range of goals. */
bool control_goto(int16_t angle);

/* Ask for a swing about 0 [hundredths of a hertz, of a degree]; return false where it is too fast or too far. */
bool control_swing(int16_t frequency, int16_t amplitude);

/* Ask for where the joint is now. */
void control_hold(void);

/* Vent where nobody has typed a line for so many seconds; 0: go on alone. */
void control_leave_alone(uint16_t seconds);

/* Note that somebody is there. */
void control_hear(void);

/* Return where the joint is, and where it is wanted to be [tenths of a degree], and the lowest and highest goal. */
int16_t control_angle(void);
int16_t control_wanted(void);
int16_t control_lowest(void);
int16_t control_highest(void);

/* Return the pressure of a muscle, 0 or 1 [hundredths of a bar]. */
int16_t control_pressure(uint8_t muscle);

/* Return how long the last decision took, and the longest since it was armed [us]. */
uint16_t control_took(void);
uint16_t control_longest(void);

/* Decide if that is due. */
void control_turn(void);

/* Return the pressure over which inlets stay closed [counts], and how long they may be open [PULSE_UNIT_US]. */
uint16_t control_most_pressure(void);
int32_t control_most_inflation(void);

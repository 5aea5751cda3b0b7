/* A servo that pneumarm has learned, whole, as C99 that needs no library.
 *
 *     real angle[SERVO_JOINTS], pressure[2 * SERVO_JOINTS];        what was read, in sensor counts
 *     real path[SERVO_PATH * SERVO_JOINTS];                        what is asked for, in counts
 *     real pulses[2 * SERVO_JOINTS];
 *
 *     servo_begin();                                               once, the arm at rest with its valves closed
 *     servo_ask();                                                 whenever something else is asked for
 *     servo_act(angle, pressure, path, false, pulses);             once every SERVO_PERIOD seconds
 *
 * pressure     of muscle 1 and of muscle 2, joint after joint.
 * path         where each joint is wanted to be: a control period ago, now, and in the periods to come, period after
 *              period. A goal that stays is the same number SERVO_PATH times. The last argument tells whether the
 *              reference is one that ever moves.
 * pulses       for each muscle the share of the control period for which its inlet (above 0) or its exhaust (below 0)
 *              is to be open, from now on.
 *
 * This is all that acts: window, policy, reference, and what brings a joint to rest and keeps it there; without plans
 * and without a simulation. It is written from the very kernels that pneumarm runs. The guard is not in it: limit
 * pressure and time yourself.
 *
 * With -DSERVO_REAL=float it computes in single precision throughout, as a small board does. -ffp-contract=off makes
 * it agree with pneumarm to the last bit of double precision, and within rounding of the network's single precision.
 * -DSERVO_EXAMPLE adds a program that moves a joint that does not move, and prints what it would do. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#ifdef __AVR__
#include <avr/pgmspace.h>
#define IN_FLASH PROGMEM
#define FROM_FLASH_FLOAT32(p) pgm_read_float(p)
#define FROM_FLASH_FLOAT64(p) pgm_read_float(p)
#define FROM_FLASH_INT64(p) ((int16_t)pgm_read_word(p))
#define FROM_FLASH_INT16(p) ((int16_t)pgm_read_word(p))
#define FROM_FLASH_INT8(p) ((int8_t)pgm_read_byte(p))
#else
#define IN_FLASH
#define FROM_FLASH_FLOAT32(p) (*(p))
#define FROM_FLASH_FLOAT64(p) (*(p))
#define FROM_FLASH_INT64(p) (*(p))
#define FROM_FLASH_INT16(p) (*(p))
#define FROM_FLASH_INT8(p) (*(p))
#endif
#ifndef SERVO_REAL
#define SERVO_REAL double
#endif
typedef SERVO_REAL real;
#define REAL(x) ((real)(x))

/* PARAMETERS */

void servo_begin(void)
{
	begin_board();
}

void servo_ask(void)
{
	ask_board();
}

void servo_see(real *angle, real *pressure, real *path, bool follows)
{
	see_board(angle, pressure, path, follows);
}

void servo_think(void)
{
	/* NETWORK */();
}

void servo_give(real *pressure, real *pulses)
{
	act_board(pressure, pulses);
}

void servo_act(real *angle, real *pressure, real *path, bool follows, real *pulses)
{
	servo_see(angle, pressure, path, follows);
	servo_think();
	servo_give(pressure, pulses);
}

#ifdef SERVO_EXAMPLE
#include <stdio.h>

int main(void)
{
	real angle[SERVO_JOINTS], pressure[2 * SERVO_JOINTS], path[SERVO_PATH * SERVO_JOINTS], pulses[2 * SERVO_JOINTS];
	for (int joint = 0; joint < SERVO_JOINTS; joint++) {
		angle[joint] = SERVO_MIDDLE; /* read them from your sensors */
		pressure[2 * joint] = pressure[2 * joint + 1] = SERVO_MOST_PRESSURE / 2;
	}
	for (int i = 0; i < SERVO_PATH * SERVO_JOINTS; i++)
		path[i] = SERVO_MIDDLE + 10 * SERVO_COUNTS_PER_DEGREE;
	servo_begin();
	for (int turn = 0; turn < 10; turn++) {
		servo_act(angle, pressure, path, false, pulses);
		for (int i = 0; i < 2 * SERVO_JOINTS; i++)
			printf("%8.4f", (double)pulses[i]); /* open the valves for this share of the period */
		printf("\n"); /* and wait for the rest of it */
	}
	return 0;
}
#endif

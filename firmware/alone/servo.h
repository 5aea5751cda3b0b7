/* The controller, as `pneumarm deploy` writes it from an agent: all that acts, and the numbers of its arm.
 *
 * SERVO is the file; it is part of control.c, so that the compiler sees both at once. */
#pragma once
#include SERVO

#if SERVO_JOINTS != 1
#error "this program drives one joint"
#endif

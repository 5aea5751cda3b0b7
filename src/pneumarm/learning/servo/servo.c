/* A servo that pneumarm has learned, as C99 that needs no library.
 *
 *     float state[SERVO_STATE], reference[SERVO_PREVIEWS][SERVO_JOINTS], pulses[SERVO_JOINTS][2];
 *     servo_act(state, reference, pulses);        once a control period, after the sensors have been read
 *
 * state        in sensor counts, newest first: for each of SERVO_HISTORY periods and each joint its angle, velocity
 *              [counts/ms], pressure of muscle 1 and of muscle 2, then what further sensors say; and after all of
 *              these the commands of the SERVO_HISTORY - 1 periods before, newest first, joint after joint.
 *              In the first period, with the arm at rest, all periods are alike, velocities and commands 0.
 * reference    where each joint is wanted to be at servo_ahead[] control periods from now [counts].
 * pulses       for each muscle the share of the period for which its inlet (above 0) or exhaust (below 0) is open.
 *
 * This is the policy. What pneumarm does besides, near a goal that stays, is not in it: single pulses with a look at
 * each, integral action, valves that stay closed at rest; and so is its guard: limit pressure and time yourself.
 */

/* PARAMETERS */

/* As in learning/servo/inputs.py and learning/servo/commands.py. */
#define SERVO_PRESSURE_CHANGE 5.0f
#define SERVO_FAR 0.05f
#define SERVO_COARSE (1.0f / 6.0f)
#define SERVO_FINE (1.0f / 1.2f)
#define SERVO_GAIN 1.25f

static float servo_bent(float z) /* hyperbolic tangent within 7e-6: Lambert's continued fraction */
{
    const float clip = 6.29701f;
    float s;
    z = z < clip ? z : clip;
    z = z > -clip ? z : -clip;
    s = z * z;
    return z * (34459425.0f + s * (4729725.0f + s * (135135.0f + s * (990.0f + s))))
           / (34459425.0f + s * (16216200.0f + s * (945945.0f + s * (13860.0f + s * 45.0f))));
}

static void servo_layer(const float *weights, int inputs, int outputs, const float *x, float *y, int bends)
{
    for (int o = 0; o < outputs; o++) {
        float sum = weights[inputs * outputs + o]; /* the last row holds the biases */
        for (int i = 0; i < inputs; i++)
            sum += weights[i * outputs + o] * x[i];
        y[o] = bends ? servo_bent(sum) : sum;
    }
}

static void servo_scale(const float *state, float *x)
{
    int place = 0;
    for (int period = 0; period < SERVO_HISTORY; period++)
        for (int i = 0; i < SERVO_OBSERVED; i++, place++)
            x[place] = (state[place] - servo_offset[i]) / servo_scales[i];
    for (int period = 1; period < SERVO_HISTORY; period++)
        for (int i = 0; i < 2 * SERVO_JOINTS; i++, place++)
            x[place] = state[place] / servo_command_scale[i];
}

static void servo_see(const float *x, const float reference[SERVO_PREVIEWS][SERVO_JOINTS], float *inputs)
{
    int row = 0;
    for (int joint = 0; joint < SERVO_JOINTS; joint++) {
        const int angle = 4 * joint;
        inputs[row++] = x[angle];
        for (int lag = 1; lag < SERVO_HISTORY; lag++)
            inputs[row++] = (x[angle] - x[lag * SERVO_OBSERVED + angle]) * (servo_rate[joint] / (float)lag);
        for (int muscle = 0; muscle < 2; muscle++) {
            const int place = angle + 2 + muscle;
            const float before = SERVO_HISTORY > 1 ? x[SERVO_OBSERVED + place] : x[place];
            inputs[row++] = x[place];
            inputs[row++] = (x[place] - before) * SERVO_PRESSURE_CHANGE;
        }
    }
    for (int i = 0; i < 2 * SERVO_JOINTS * (SERVO_HISTORY - 1); i++)
        inputs[row++] = x[SERVO_HISTORY * SERVO_OBSERVED + i];
    for (int joint = 0; joint < SERVO_JOINTS; joint++)
        for (int p = 0; p < SERVO_PREVIEWS; p++) {
            const float wanted = (reference[p][joint] - servo_offset[4 * joint]) / servo_scales[4 * joint];
            const float distance = (wanted - x[4 * joint]) * servo_tolerances[joint];
            inputs[row++] = distance * SERVO_FAR;
            inputs[row++] = servo_bent(distance * SERVO_COARSE);
            inputs[row++] = servo_bent(distance * SERVO_FINE);
        }
}

static float servo_pulse(float said, float pressure, float limit)
{
    const float v = SERVO_GAIN * servo_bent(said);
    float size = ((v < 0 ? -v : v) - SERVO_DEAD) / (1.0f - SERVO_DEAD);
    if (v > 0 && pressure > limit)
        size = 0;
    size = size < 0 ? 0 : size > 1 ? 1 : size;
    if (SERVO_STEP > 0) {
        size = SERVO_STEP * (float)(int)(size / SERVO_STEP + 0.5f);
        size = size > 1 ? 1 : size;
    } else if (size < 0.5f * SERVO_SHORTEST)
        size = 0;
    else if (size > SERVO_WHOLE)
        size = 1;
    else if (size < SERVO_SHORTEST)
        size = SERVO_SHORTEST;
    return v > 0 ? size : -size;
}

void servo_act(
    const float state[SERVO_STATE],
    const float reference[SERVO_PREVIEWS][SERVO_JOINTS],
    float pulses[SERVO_JOINTS][2])
{
    float x[SERVO_STATE], a[SERVO_WIDEST], b[SERVO_WIDEST], *now = a, *next = b;
    const float *weights = servo_weights;
    servo_scale(state, x);
    servo_see(x, reference, now);
    for (int layer = 0; layer < SERVO_LAYERS; layer++) {
        float *free = now;
        servo_layer(weights, servo_sizes[layer], servo_sizes[layer + 1], now, next, layer < SERVO_LAYERS - 1);
        weights += (servo_sizes[layer] + 1) * servo_sizes[layer + 1];
        now = next;
        next = free;
    }
    for (int joint = 0; joint < SERVO_JOINTS; joint++)
        for (int muscle = 0; muscle < 2; muscle++)
            pulses[joint][muscle] =
                servo_pulse(now[2 * joint + muscle], x[4 * joint + 2 + muscle], servo_inlet[joint][muscle]);
}

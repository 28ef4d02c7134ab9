/* The physics of plant-sim for a motion controller in C: a robot, its surface and its sensors, without a clock of its
 * own. One cycle: plant_measure, plant_truth, plant_follow until plant_cycle_end_ns, plant_arrive. */
#ifndef PLANT_H
#define PLANT_H

#include "admittanced.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct plant plant;

/* What plant_open says of the scenario. */
typedef struct plant_timing {
    uint64_t sampling_time_ns;
    uint64_t command_delay_ns;
    uint32_t joint_count;
    uint32_t reserved;
} plant_timing;

/* What the controller says of a cycle, for its truth. */
typedef struct plant_cycle {
    uint64_t answer_time_ns;
    uint64_t lateness_ns;
    uint64_t missed_commands;
    double velocity_offset[ADMITTANCED_TASK_AXES];
    uint32_t motion;
    uint32_t missed;
} plant_cycle;

/* The plant of a scenario file, its first sample at this instant; NULL, and a line on stderr, when there is none. */
plant *plant_open(const char *scenario, uint64_t first_stamp_ns, plant_timing *timing);
void plant_close(plant *plant);
/* When the present cycle ends. */
uint64_t plant_cycle_end_ns(const plant *plant);
/* Whether the motion is over. */
int plant_is_finished(const plant *plant);
/* What is measured, faults of the scenario included; whose sample it is stays as it was unless a fault falsifies it.
 * 0 when a fault keeps the sample from being published. */
int plant_measure(const plant *plant, admittanced_state_sample *sample);
/* Whether the controller can see commands: a fault may hide them. */
int plant_shows_commands(const plant *plant);
/* Writes the truth of the sample's instant to the file or pipe that PLANT_TRUTH names, as a TruthSample. */
void plant_truth(plant *plant, const plant_cycle *cycle);
/* The joints follow this until then, at most to the end of the cycle; the instant that was reached. */
uint64_t plant_follow(plant *plant, uint32_t motion, const double *velocity_offset, uint64_t until_ns);
/* The next sample. The motion waits until a command was received. */
void plant_arrive(plant *plant, int has_received);

#ifdef __cplusplus
}
#endif

#endif

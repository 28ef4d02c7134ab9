/* What a cycle of the C client costs besides time: fence ROOT_PATH PREFIX INSTANCE cycle|spoilt, with a daemon of two
 * joints there. It counts calls to the heap from measuring to following, and asks for its parent before and after
 * those cycles, so that strace shows the system calls between. It ends with 1 when there were allocations, or more than
 * one free a cycle. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "admittance_client.h"

#define WARM_UP 50
#define CYCLES 250
#define SAMPLING_TIME_NS 4000000u

/* glibc's own heap, which the functions below stand before. */
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);
void __libc_free(void *old);

static int is_counting;
static unsigned long allocations, frees;

void *malloc(size_t size) {
    allocations += (unsigned long)is_counting;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    allocations += (unsigned long)is_counting;
    return __libc_calloc(count, size);
}

void *realloc(void *old, size_t size) {
    allocations += (unsigned long)is_counting;
    return __libc_realloc(old, size);
}

void free(void *old) {
    frees += (unsigned long)is_counting;
    __libc_free(old);
}

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

int main(int argc, char **argv) {
    admittance_options options;
    admittance_client *client;
    admittanced_state_sample sample;
    admittance_instruction instruction;
    char message[512];
    unsigned long answered = 0;
    uint64_t stamp_ns;
    int i, is_spoilt;

    if (argc != 5)
        return 64;
    is_spoilt = strcmp(argv[4], "spoilt") == 0;
    memset(&options, 0, sizeof options);
    options.root_path = argv[1];
    options.prefix = argv[2];
    options.instance = argv[3];
    options.name = "fence.c";
    options.sampling_time_ns = SAMPLING_TIME_NS;
    options.command_delay_ns = 1000000u;
    for (i = 0; i < ADMITTANCED_TASK_AXES; i++)
        options.velocity_offset_limit[i] = INFINITY;
    for (i = 0; i < ADMITTANCED_MAX_JOINTS; i++)
        options.joint_velocity_offset_limit[i] = INFINITY;
    options.joint_count = 2;
    options.abi_version = ADMITTANCE_CLIENT_ABI_VERSION;
    if (admittance_client_open(&options, &client, message, sizeof message) < 0) {
        fprintf(stderr, "%s\n", message);
        return 69;
    }
    stamp_ns = now_ns() + SAMPLING_TIME_NS;
    for (i = 0; i < WARM_UP + CYCLES; i++, stamp_ns += SAMPLING_TIME_NS) {
        if (i == WARM_UP) {
            answered = allocations = frees = 0;
            (void)getppid();
        }
        while (now_ns() < stamp_ns) {
        }
        is_counting = 1;
        if (is_spoilt) {
            void *volatile unneeded = malloc(8);
            free(unneeded);
            (void)getpid();
        }
        admittance_client_begin(client, stamp_ns, &sample);
        sample.joint_position[0] = sample.joint_position_reference[0] = 1.2;
        sample.joint_position[1] = sample.joint_position_reference[1] = -1.3;
        sample.wrench_valid = sample.drives_enabled = 1;
        admittance_client_publish(client, &sample);
        for (;;) {
            uint64_t now = now_ns();
            admittance_status status = admittance_client_receive(client, now);
            if (status != ADMITTANCE_STATUS_NO_ANSWER || now > stamp_ns + SAMPLING_TIME_NS / 2) {
                answered += status == ADMITTANCE_STATUS_OK || status == ADMITTANCE_STATUS_LATE;
                break;
            }
        }
        admittance_client_apply(client, now_ns(), &instruction);
        is_counting = 0;
        admittance_client_make_ready(client);
    }
    (void)getppid();
    admittance_client_close(client);
    printf("%lu of %d answered, %lu allocations, %lu frees\n", answered, CYCLES, allocations, frees);
    /* What make_ready has taken is given back when it is sent: that is the one call to the heap. */
    return answered > 0 && allocations == 0 && frees <= CYCLES ? 0 : 1;
}

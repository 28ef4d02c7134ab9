// A cycle in C++ without a robot: raii ROOT_PATH PREFIX INSTANCE. It says what went wrong, and ends with 1.
#include <cmath>
#include <cstdio>
#include <thread>
#include <utility>

#include "admittance_client.hpp"

namespace {

bool expect(bool is_so, const char *what) {
    if (!is_so)
        std::fprintf(stderr, "not so: %s\n", what);
    return is_so;
}

admittance_options options_of(char **argv) {
    admittance_options options = admittance::options();
    options.root_path = argv[1];
    options.prefix = argv[2];
    options.instance = argv[3];
    options.name = "raii.cpp";
    options.sampling_time_ns = 4000000;
    options.command_delay_ns = 250000;
    options.joint_count = 6;
    for (double &limit : options.velocity_offset_limit)
        limit = 1.0;
    for (double &limit : options.joint_velocity_offset_limit)
        limit = INFINITY;
    return options;
}

bool a_cycle_without_a_daemon(admittance::client client) {
    admittanced_state_sample sample;
    admittance_instruction instruction;
    admittanced_command_sample command;
    bool good = expect(client.begin(1000000000, sample) == ADMITTANCE_STATUS_OK, "a cycle begins");
    good &= expect(sample.sequence == 1 && sample.boot_id != 0 && sample.wrench_valid == 0, "the sample is identified");
    good &= expect(admittance::joint_position(sample).size() == 6, "as many positions as joints");
    for (double &position : admittance::joint_position(sample))
        position = 0.5;
    admittance::wrench(sample)[2] = 10.0;
    good &= expect(sample.joint_position[5] == 0.5 && sample.joint_position[6] == 0.0, "a view writes the sample");
    good &= expect(client.publish(sample) == ADMITTANCE_STATUS_OK, "it is published");
    good &= expect(client.receive(1000100000) == ADMITTANCE_STATUS_NO_ANSWER, "nobody answers");
    good &= expect(client.newest(command) == ADMITTANCE_STATUS_NO_ANSWER, "nobody has ever answered");
    good &= expect(client.apply(1000250000, instruction) == ADMITTANCE_STATUS_OK, "there is an instruction");
    good &= expect(instruction.motion == ADMITTANCED_MOTION_OFFSET && admittance::velocity_offset(instruction)[0] == 0.0,
                   "before the first answer ever the offset is zero");
    return good & expect(client.make_ready() == ADMITTANCE_STATUS_OK, "there is room for the next");
}

} // namespace

int main(int argc, char **argv) {
    if (argc != 4)
        return 64;
    admittance_options options = options_of(argv);
    bool good = true;
    try {
        admittance::client client(options);
        // It is opened in one thread and used in another, as a controller manager does.
        std::thread other([&good, moved = std::move(client)]() mutable { good = a_cycle_without_a_daemon(std::move(moved)); });
        other.join();
        // The first one has closed itself: there is room for another controller.
        admittance::client again(options);
        options.velocity_offset_limit[1] = 0.0;
        admittance::client refused(options);
        good = expect(false, "a limit of zero is refused");
    } catch (const admittance::error &error) {
        good &= expect(error.status() == ADMITTANCE_STATUS_INVALID_ARGUMENT, error.what());
        std::puts(error.what());
    }
    return good ? 0 : 1;
}

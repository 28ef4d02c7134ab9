// The C client for C++17 and later: a handle that closes itself, and views instead of pointers and lengths. With C++20
// a view is std::span; before, C++ has none, and `span` here is what of it the calls need.
#ifndef ADMITTANCE_CLIENT_HPP
#define ADMITTANCE_CLIENT_HPP

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#if __has_include(<version>)
#include <version>
#endif
#ifdef __cpp_lib_span
#include <span>
#endif

#include "admittance_client.h"

namespace admittance {

#ifdef __cpp_lib_span
using std::span;
#else
template <class T> class span {
  public:
    constexpr span(T *first, std::size_t size) noexcept : first_(first), size_(size) {}
    constexpr T *data() const noexcept { return first_; }
    constexpr std::size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T &operator[](std::size_t index) const { return first_[index]; }
    constexpr T *begin() const noexcept { return first_; }
    constexpr T *end() const noexcept { return first_ + size_; }

  private:
    T *first_;
    std::size_t size_;
};
#endif

// Ports that do not open. The calls of a cycle throw nothing.
class error : public std::runtime_error {
  public:
    error(admittance_status status, const char *why) : std::runtime_error(why), status_(status) {}
    admittance_status status() const noexcept { return status_; }

  private:
    admittance_status status_;
};

// Options with nothing but the version set.
inline admittance_options options() noexcept {
    admittance_options empty{};
    empty.abi_version = ADMITTANCE_CLIENT_ABI_VERSION;
    return empty;
}

// Joints of a sample, base to tip: rad and rad/s, of those that slide m and m/s.
inline span<double> joint_position(admittanced_state_sample &sample) noexcept {
    return {sample.joint_position, sample.joint_count};
}
inline span<double> joint_velocity(admittanced_state_sample &sample) noexcept {
    return {sample.joint_velocity, sample.joint_count};
}
inline span<double> joint_position_reference(admittanced_state_sample &sample) noexcept {
    return {sample.joint_position_reference, sample.joint_count};
}
// What the motors give, on the joints' side of their gears, for a daemon with wrench.source = "motor_torque": N m.
inline span<double> joint_torque(admittanced_state_sample &sample) noexcept {
    return {sample.joint_torque, sample.joint_count};
}
// x y z rx ry rz at the TCP, base frame: m/s and rad/s; N and N m that the robot exerts on the environment.
inline span<double> twist_reference(admittanced_state_sample &sample) noexcept {
    return {sample.twist_reference, ADMITTANCED_TASK_AXES};
}
inline span<double> wrench(admittanced_state_sample &sample) noexcept { return {sample.wrench, ADMITTANCED_TASK_AXES}; }
inline span<const double> velocity_offset(const admittance_instruction &instruction) noexcept {
    return {instruction.velocity_offset, ADMITTANCED_TASK_AXES};
}

// A motion controller's side. It can be moved, not copied; any thread may use it, one at a time.
class client {
  public:
    explicit client(const admittance_options &options) {
        char why[512];
        admittance_client *opened = nullptr;
        const admittance_status status = admittance_client_open(&options, &opened, why, sizeof why);
        if (status < 0)
            throw error(status, why);
        handle_.reset(opened);
    }

    // The calls of admittance_client.h, where each is described.
    admittance_status begin(std::uint64_t stamp_ns, admittanced_state_sample &sample) noexcept {
        return admittance_client_begin(handle_.get(), stamp_ns, &sample);
    }
    admittance_status publish(const admittanced_state_sample &sample) noexcept {
        return admittance_client_publish(handle_.get(), &sample);
    }
    admittance_status receive(std::uint64_t now_ns) noexcept { return admittance_client_receive(handle_.get(), now_ns); }
    // With a status below 0 the instruction is to hold.
    admittance_status apply(std::uint64_t now_ns, admittance_instruction &instruction) noexcept {
        instruction = {};
        instruction.motion = ADMITTANCED_MOTION_HOLD;
        return admittance_client_apply(handle_.get(), now_ns, &instruction);
    }
    // What the joints add to their commanded velocity: with follows_joint_velocity = 1. ADMITTANCED_MAX_JOINTS numbers.
    admittance_status joint_velocity_offset(std::uint64_t now_ns, double *offset) noexcept {
        return admittance_client_joint_velocity_offset(handle_.get(), now_ns, offset);
    }
    admittance_status make_ready() noexcept { return admittance_client_make_ready(handle_.get()); }
    admittance_status newest(admittanced_command_sample &command) noexcept {
        return admittance_client_newest(handle_.get(), &command);
    }
    admittance_status counts(std::uint64_t until_ns, admittance_counts &counts) noexcept {
        return admittance_client_counts(handle_.get(), until_ns, &counts);
    }
    const char *text() const noexcept { return admittance_client_text(handle_.get()); }

  private:
    struct close {
        void operator()(admittance_client *handle) const noexcept { admittance_client_close(handle); }
    };
    std::unique_ptr<admittance_client, close> handle_;
};

} // namespace admittance

#endif

// A C++11 class around the functions of an exported file, for `exported/any_wheel.onnx`.
#pragma once

#include <stdexcept>
#include <vector>

#include "any_wheel.h"

// The soil under one wheel, from all rows since the last call of `restart`.
class SoilEstimator {
public:
    explicit SoilEstimator(const any_wheel_context &wheel) : wheel_(wheel) { restart(); }

    // Forget all rows: the wheel is on another soil.
    void restart() { check(any_wheel_set_start(&memory_, &wheel_)); }

    // Add one row; returns whether it lies in the range of the file.
    bool add(const any_wheel_row &row)
    {
        bool in_range = false;
        check(any_wheel_set_step(&memory_, &row, 1, &in_range, nullptr, &work()));
        return in_range;
    }

    // The estimate from all rows so far.
    any_wheel_set_estimate answer() const
    {
        any_wheel_set_estimate estimate;
        check(any_wheel_set_answer(&memory_, &estimate, &work()));
        return estimate;
    }

private:
    // Scratch memory of calls, which all estimators of a thread share.
    static any_wheel_work &work()
    {
        static thread_local std::vector<any_wheel_work> shared(1);
        return shared[0];
    }

    static void check(int code)
    {
        if (code < 0)
            throw std::invalid_argument(any_wheel_message(code));
    }

    any_wheel_context wheel_;
    any_wheel_memory memory_;
};

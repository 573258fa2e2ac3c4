// Two wheels of different sizes on one rover, each with an estimator of its own:
//
//   soilml export c exported/any_wheel.onnx any_wheel.c
//   gcc -std=c99 -O3 -c any_wheel.c
//   g++ -std=c++11 -O3 -I. examples/board/main.cpp any_wheel.o -lm -o board && ./board
#include <cstdio>
#include <exception>

#include "soil_estimator.hpp"

static any_wheel_context wheel_on_dry_sand(float radius, float width)
{
    any_wheel_context wheel = any_wheel_usual_context(); // errors of sensors and of the model
    wheel.wheel_radius = radius;
    wheel.wheel_width = width;
    wheel.bearing_modulus = 1.537e6f;
    wheel.n = 1.1f;
    wheel.bearing_std = 0.1f;
    wheel.cohesion_max = 3000.0f;
    wheel.shear_modulus_max = 0.03f;
    return wheel;
}

int main()
{
    try {
        SoilEstimator front(wheel_on_dry_sand(0.15f, 0.12f)), rear(wheel_on_dry_sand(0.20f, 0.12f));
        const float slip[] = {0.1f, 0.2f, 0.3f, 0.45f};
        const float front_torque[] = {1.21f, 1.75f, 2.29f, 2.82f};
        const float rear_torque[] = {1.55f, 2.50f, 3.16f, 4.10f};
        for (int i = 0; i < 4; ++i) {
            any_wheel_row row = any_wheel_empty_row();
            row.slip = slip[i];
            row.load = 60.0f;
            row.torque = front_torque[i];
            front.add(row);
            row.torque = rear_torque[i];
            rear.add(row);
        }
        for (const SoilEstimator *wheel : {&front, &rear}) {
            const any_wheel_set_estimate soil = wheel->answer();
            std::printf("friction angle %.3f +- %.3f rad, %s\n", double(soil.mean[1]),
                        double(soil.std[1]), soil.in_range ? "in range" : "out of range");
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}

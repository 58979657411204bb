// Evaluates mechanism_sim/msg/Motion, from which every position between two samples is known.
#ifndef MECHANISM_SIM__MOTION_HPP_
#define MECHANISM_SIM__MOTION_HPP_

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace mechanism_sim
{

/// Angle [rad] or displacement [m] of a coordinate, and its first two derivatives in time.
struct Sample
{
  double position, velocity, acceleration;
};

/// Whether the segments of a message hold time t [s]: its pieces follow each other without gaps.
template<class MotionMessage>
bool holds(const MotionMessage & m, double t)
{
  return m.segments > 0 && t >= m.start.front() &&
         t <= m.start.back() + (m.start_low.back() + m.duration.back());
}

/// Coordinate i of `m.coordinates` at time t [s], by the polynomial of the segment that holds t:
/// 2 pi turns[k, i] + sum_j coefficients[k, i, j] (t - start[k] - start_low[k])^j.
/// Throws std::out_of_range if there is none, or no such coordinate.
template<class MotionMessage>
Sample evaluate(const MotionMessage & m, std::size_t i, double t)
{
  const std::size_t n = m.coordinates.size(), terms = m.degree + 1;
  if (!holds(m, t) || i >= n) {
    throw std::out_of_range("a Motion message does not hold this time, or this coordinate");
  }
  const auto after = std::upper_bound(m.start.begin(), m.start.end(), t);
  const std::size_t k = static_cast<std::size_t>(after - m.start.begin()) - 1;
  const double dt = (t - m.start[k]) - m.start_low[k];
  Sample s{0.0, 0.0, 0.0};
  for (std::size_t j = terms; j-- > 0;) {  // Horner's scheme, for all three at once
    s.acceleration = s.acceleration * dt + 2.0 * s.velocity;
    s.velocity = s.velocity * dt + s.position;
    s.position = s.position * dt + m.coefficients[(k * n + i) * terms + j];
  }
  s.position += 6.283185307179586 * static_cast<double>(m.turns[k * n + i]);
  return s;
}

}  // namespace mechanism_sim

#endif  // MECHANISM_SIM__MOTION_HPP_

// A god-object on a triangle mesh: the tool flies to the hand, stops at the triangles on its way, and slides on them.
//
// It stays MARGIN off the triangles. In a tick it collects the planes that it runs into; its goal is the point nearest
// to the hand that none of them bars, on a plane, on the line of two or in the corner of three. Each step goes through
// all triangles: put a search tree here for large meshes.
#include <array>
#include <cmath>
#include <limits>
#include <new>
#include <vector>

#include "hapticeval.h"

namespace {

using Vec = std::array<double, 3>;

constexpr double MARGIN = 1e-6;   // m
constexpr double SLACK = 1e-9;    // of a triangle by which a way past its side still meets it; of MARGIN at rest
constexpr std::size_t MOST = 12;  // planes that are collected in a tick

double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec add(const Vec& a, double s, const Vec& b) { return {a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]}; }
Vec sub(const Vec& a, const Vec& b) { return add(a, -1.0, b); }
Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

struct Plane {
  Vec normal;
  double offset;  // points x with normal . x >= offset are free
};

struct Triangle {
  Plane plane;
  Vec corner;
  Vec first, second;  // first . (x - corner) and second . (x - corner) are two barycentric coordinates
};

class GodObject {
 public:
  explicit GodObject(const hr_scene& scene) : stiffness_(scene.stiffness) {
    triangles_.reserve(scene.n_cells);
    for (uint32_t k = 0; k < scene.n_cells; ++k) {
      std::array<Vec, 3> p;
      for (uint32_t i = 0; i < 3; ++i) {
        const double* at = scene.vertices + 3 * static_cast<std::size_t>(scene.cells[3 * k + i]);
        p[i] = {at[0], at[1], at[2]};
      }
      const Vec u = sub(p[1], p[0]), v = sub(p[2], p[0]), area = cross(u, v);
      const double size = std::sqrt(dot(area, area));
      const Vec normal = add({0.0, 0.0, 0.0}, 1.0 / size, area);
      const Vec first = cross(v, normal), second = cross(normal, u);
      triangles_.push_back({{normal, dot(normal, p[0])},
                            p[0],
                            add({0.0, 0.0, 0.0}, 1.0 / size, first),
                            add({0.0, 0.0, 0.0}, 1.0 / size, second)});
    }
  }

  void reset(const Vec& tool) { tool_ = tool; }

  // Move the tool towards the hand; return whether anything stops it.
  bool move(const Vec& hip) {
    Vec goal = hip;
    std::vector<Plane>& met = met_;
    met.clear();
    while (true) {
      double share = 1.0;
      const Triangle* hit = first_hit(goal, share);
      tool_ = hit ? add(tool_, share, sub(goal, tool_)) : goal;
      if (!hit) break;
      met.push_back({hit->plane.normal, hit->plane.offset + MARGIN});
      if (met.size() == MOST || !nearest(hip, goal)) break;
    }
    return !met.empty();
  }

  const Vec& tool() const { return tool_; }
  double stiffness() const { return stiffness_; }

 private:
  // The triangle that the tool first comes within MARGIN of on its way to the goal, and at which share of the way.
  const Triangle* first_hit(const Vec& goal, double& share) const {
    const Triangle* hit = nullptr;
    const Vec way = sub(goal, tool_);
    for (const Triangle& each : triangles_) {
      const double end = dot(each.plane.normal, goal) - each.plane.offset;
      if (end >= MARGIN * (1.0 - SLACK)) continue;
      const double begin = dot(each.plane.normal, tool_) - each.plane.offset;
      if (begin < 0.0 || begin <= end) continue;  // from behind, or away
      const double at = std::fmax((begin - MARGIN) / (begin - end), 0.0);
      if (at >= share) continue;
      const double through = end < 0.0 ? begin / (begin - end) : 1.0;
      const Vec from = sub(add(tool_, through, way), each.corner);
      const double u = dot(each.first, from), v = dot(each.second, from);
      if (u < -SLACK || v < -SLACK || u + v > 1.0 + SLACK) continue;
      hit = &each;
      share = at;
    }
    return hit;
  }

  // Put goal to the point nearest to the hand that no plane met so far bars; return false where there is none.
  bool nearest(const Vec& hip, Vec& goal) const {
    double best = std::numeric_limits<double>::infinity();
    const std::size_t n = met_.size();
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = i; j < n; ++j) {
        for (std::size_t k = j; k < n; ++k) {
          if (i == j && j != k) continue;  // the two planes of i < j = k again
          Vec x;
          if (!on_planes(hip, i, j, k, x)) continue;
          const Vec off = sub(x, hip);
          if (dot(off, off) < best && free(x)) {
            best = dot(off, off);
            goal = x;
          }
        }
      }
    }
    return best < std::numeric_limits<double>::infinity();
  }

  bool free(const Vec& x) const {
    for (const Plane& each : met_) {
      if (dot(each.normal, x) < each.offset - SLACK * MARGIN) return false;
    }
    return true;
  }

  // The foot of the hand on one plane (i = j = k), on the line of two (j = k) or the point of three.
  bool on_planes(const Vec& hip, std::size_t i, std::size_t j, std::size_t k, Vec& x) const {
    const Plane &a = met_[i], &b = met_[j];
    const double da = a.offset - dot(a.normal, hip), db = b.offset - dot(b.normal, hip);
    if (i == k) {
      x = add(hip, da, a.normal);
      return true;
    }
    const Vec line = cross(a.normal, b.normal);
    if (j == k) {
      const double square = dot(line, line), c = dot(a.normal, b.normal);
      if (square < 1e-20) return false;
      x = add(add(hip, (da - c * db) / square, a.normal), (db - c * da) / square, b.normal);
      return true;
    }
    const Plane& d = met_[k];
    const double volume = dot(line, d.normal), dd = d.offset - dot(d.normal, hip);
    if (std::fabs(volume) < 1e-12) return false;
    x = add(hip, da / volume, cross(b.normal, d.normal));
    x = add(add(x, db / volume, cross(d.normal, a.normal)), dd / volume, line);
    return true;
  }

  double stiffness_;
  std::vector<Triangle> triangles_;
  std::vector<Plane> met_;
  Vec tool_{};
};

Vec vec(const double* p) { return {p[0], p[1], p[2]}; }

}  // namespace

uint32_t hr_abi(void) { return HR_ABI; }

int32_t hr_info_get(const void* self, hr_info* info) {
  if (self) {
    info->standoff = MARGIN;
  } else {
    info->flags = HR_SPACE | HR_SPRING;
  }
  return HR_OK;
}

int32_t hr_create(const hr_scene* scene, void** self, char*, uint32_t) {
  try {
    *self = new GodObject(*scene);
  } catch (const std::bad_alloc&) {
    return -1;  // no exception may leave
  }
  return HR_OK;
}

int32_t hr_reset(void* self, const double*, const double* tool) {
  static_cast<GodObject*>(self)->reset(vec(tool));
  return HR_OK;
}

int32_t hr_step(void* self, const double* hip, const double*, double, double* ihip, double* force) {
  GodObject& god_object = *static_cast<GodObject*>(self);
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(hip[i])) return HR_REFUSES_HIP;
  }
  const bool contact = god_object.move(vec(hip));
  for (int i = 0; i < 3; ++i) {
    ihip[i] = god_object.tool()[static_cast<std::size_t>(i)];
    force[i] = contact ? god_object.stiffness() * (ihip[i] - hip[i]) : 0.0;
  }
  return contact ? HR_CONTACT : HR_FREE;
}

void hr_destroy(void* self) { delete static_cast<GodObject*>(self); }

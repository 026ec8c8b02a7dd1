#include "integrator/scene_motion.h"

#include <algorithm>
#include <cmath>

#include "kernel/math/step_place.h"

namespace relief {

namespace {

/// Columns of a 3×3 matrix.
struct Matrix {
  double m[9];  ///< column by column
};

double at(const Matrix& a, int row, int column) { return a.m[3 * column + row]; }

/// Inverse of the transpose.
Matrix inverse_transpose(const Matrix& a)
{
  const auto cofactor = [&](int row, int column) {
    const int r0 = (row + 1) % 3, r1 = (row + 2) % 3, c0 = (column + 1) % 3, c1 = (column + 2) % 3;
    return at(a, r0, c0) * at(a, r1, c1) - at(a, r0, c1) * at(a, r1, c0);
  };
  const double determinant = at(a, 0, 0) * cofactor(0, 0) + at(a, 0, 1) * cofactor(0, 1) + at(a, 0, 2) * cofactor(0, 2);
  Matrix out;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) out.m[3 * column + row] = cofactor(row, column) / determinant;
  }
  return out;
}

double norm(const Matrix& a)
{
  double sum = 0;
  for (const double v : a.m) sum += v * v;
  return std::sqrt(sum);
}

/// The rotation nearest to a matrix, or the rotation and mirroring.
Matrix nearest_orthogonal(Matrix a)
{
  // Steps square the error once it is small; before, scaling brings the singular values together.
  constexpr int kMostSteps = 100;
  for (int step = 0; step < kMostSteps; ++step) {
    const Matrix b = inverse_transpose(a);
    const double scale = std::sqrt(norm(b) / norm(a));
    Matrix next;
    double change = 0;
    for (int i = 0; i < 9; ++i) {
      next.m[i] = 0.5 * (scale * a.m[i] + b.m[i] / scale);
      change = std::max(change, std::abs(next.m[i] - a.m[i]));
    }
    a = next;
    if (!(change > 1e-15)) break;
  }
  return a;
}

/// Of a rotation.
void quaternion_of(const Matrix& r, double* q)
{
  const double x = at(r, 0, 0), y = at(r, 1, 1), z = at(r, 2, 2);
  // From the largest of the four, so that none is divided by little.
  const double squares[4] = {1 + x - y - z, 1 - x + y - z, 1 - x - y + z, 1 + x + y + z};
  const auto largest = static_cast<int>(std::max_element(squares, squares + 4) - squares);
  const double twice = std::sqrt(squares[largest]), scale = 0.5 / twice;
  const auto sum = [&](int i, int j) { return scale * (at(r, i, j) + at(r, j, i)); };
  const auto difference = [&](int i, int j) { return scale * (at(r, i, j) - at(r, j, i)); };
  q[largest] = 0.5 * twice;
  if (largest == 3) {
    q[0] = difference(2, 1);
    q[1] = difference(0, 2);
    q[2] = difference(1, 0);
    return;
  }
  const int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
  q[j] = sum(i, j);
  q[k] = sum(i, k);
  q[3] = difference(k, j);
}

}  // namespace

MotionKey motion_key_make(const Affine3& m, const MotionKey* before)
{
  MotionKey key;
  const Vec3f columns[3] = {m.x, m.y, m.z};
  Matrix a;
  for (int c = 0; c < 3; ++c) {
    const Vec3f v = columns[c];
    a.m[3 * c] = v.x;
    a.m[3 * c + 1] = v.y;
    a.m[3 * c + 2] = v.z;
  }
  Matrix rotation = nearest_orthogonal(a);
  const double handedness =
      at(rotation, 0, 0) * (at(rotation, 1, 1) * at(rotation, 2, 2) - at(rotation, 2, 1) * at(rotation, 1, 2)) -
      at(rotation, 1, 0) * (at(rotation, 0, 1) * at(rotation, 2, 2) - at(rotation, 2, 1) * at(rotation, 0, 2)) +
      at(rotation, 2, 0) * (at(rotation, 0, 1) * at(rotation, 1, 2) - at(rotation, 1, 1) * at(rotation, 0, 2));
  if (handedness < 0) {
    for (double& v : rotation.m) v = -v;
  }
  key.p[0] = m.p.x;
  key.p[1] = m.p.y;
  key.p[2] = m.p.z;
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) {
      double sum = 0;
      for (int i = 0; i < 3; ++i) sum += at(rotation, i, r) * at(a, i, c);
      key.s[3 * c + r] = sum;
    }
  }
  quaternion_of(rotation, key.q);
  if (before != nullptr) {
    double cosine = 0;
    for (int i = 0; i < 4; ++i) cosine += key.q[i] * before->q[i];
    if (cosine < 0) {
      for (double& v : key.q) v = -v;
    }
  }
  return key;
}

double motion_stray(const MotionKey& from, const MotionKey& to, double reach)
{
  // T + R S x, with T and S straight and R turning evenly by θ, has the second derivative R″ S x + 2 R′ S′ x, and a function
  // strays from its chord by at most an eighth of the largest of that.
  double cosine = 0, stretch = 0, change = 0;
  for (int i = 0; i < 4; ++i) cosine += from.q[i] * to.q[i];
  for (int i = 0; i < 9; ++i) {
    stretch += std::max(from.s[i] * from.s[i], to.s[i] * to.s[i]);
    change += (to.s[i] - from.s[i]) * (to.s[i] - from.s[i]);
  }
  const double angle = 2 * std::acos(std::clamp(cosine, -1.0, 1.0));
  return reach * angle * (angle * std::sqrt(stretch) + 2 * std::sqrt(change)) / 8;
}

SceneMotion::SceneMotion(const Scene& scene) : scene_(scene)
{
  std::size_t num_keys = 0;
  for (const std::vector<Affine3>& steps : scene.motions) num_keys += steps.size();
  keys_.reserve(num_keys);  // views point into it
  for (const std::vector<Affine3>& steps : scene.motions) {
    views_.push_back({keys_.data() + keys_.size(), static_cast<std::uint32_t>(steps.size())});
    for (std::size_t i = 0; i < steps.size(); ++i) {
      keys_.push_back(motion_key_make(steps[i], i > 0 ? &keys_.back() : nullptr));
    }
  }
  for (const Mesh& mesh : scene.meshes) {
    std::vector<MeshShape>& shapes = shapes_.emplace_back();
    for (const MeshStep& step : mesh.steps) {
      shapes.push_back({step.P.data(), step.N.empty() ? nullptr : step.N.data()});
    }
  }
  is_open_ = !views_.empty() || std::any_of(scene.meshes.begin(), scene.meshes.end(),
                                            [](const Mesh& mesh) { return !mesh.steps.empty(); });
}

InstanceView SceneMotion::instance_at(const InstanceView& centre, float time) const
{
  InstanceView out = centre;
  if ((centre.flags & kMoves) == 0) return out;
  out.world_from_object = motion_at(view(scene_.instances[centre.index].motion_index), time);
  out.object_from_world = inverse(out.world_from_object);
  return out;
}

MeshView SceneMotion::mesh_at(const InstanceView& instance, const MeshView& centre, float time) const
{
  MeshView out = centre;
  if ((instance.flags & kDeforms) == 0) return out;
  const std::vector<MeshShape>& steps = shapes(static_cast<std::size_t>(instance.mesh_index));
  const StepPlace place = step_place(time, static_cast<std::uint32_t>(steps.size()));
  const MeshShape &before = steps[place.step], &next = steps[place.step + 1];
  out.part = place.part;
  out.P = before.P;
  out.P_next = next.P;
  if (centre.N != nullptr) {
    out.N = before.N;
    out.N_next = next.N;
  }
  return out;
}

}  // namespace relief

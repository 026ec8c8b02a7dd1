#include "integrator/medium_photon_map.h"

#include <algorithm>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace relief {

namespace {

constexpr std::uint32_t kCurveBits = 20;  ///< an axis

/// A number's bits, each with two zeros above it.
std::uint64_t bits_spread(std::uint32_t v)
{
  std::uint64_t spread = 0;
  for (std::uint32_t bit = 0; bit < kCurveBits; ++bit) spread |= std::uint64_t{v >> bit & 1u} << (3 * bit);
  return spread;
}

/// Place of a point along Morton's curve through a box.
std::uint64_t curve_key(const Box3& box, Vec3f P)
{
  const auto cell = [](float low, float high, float x) {
    const float share = high > low ? (x - low) / (high - low) : 0.0f;
    constexpr auto kCells = static_cast<float>(1u << kCurveBits);
    return static_cast<std::uint32_t>(std::clamp(share * kCells, 0.0f, kCells - 1.0f));
  };
  return bits_spread(cell(box.low.x, box.high.x, P.x)) | bits_spread(cell(box.low.y, box.high.y, P.y)) << 1 |
         bits_spread(cell(box.low.z, box.high.z, P.z)) << 2;
}

void set_box(PhotonBoxes& boxes, std::size_t child, const Box3& box)
{
  const Vec3f low = box.low, high = box.high;
  boxes.low[0][child] = low.x;
  boxes.low[1][child] = low.y;
  boxes.low[2][child] = low.z;
  boxes.high[0][child] = high.x;
  boxes.high[1][child] = high.y;
  boxes.high[2][child] = high.z;
}

/// Around the first children of a node.
Box3 box_around(const PhotonBoxes& boxes, std::size_t count)
{
  Box3 box = box_empty();
  for (std::size_t i = 0; i < count; ++i) {
    box = box_union(box, {{boxes.low[0][i], boxes.low[1][i], boxes.low[2][i]},
                          {boxes.high[0][i], boxes.high[1][i], boxes.high[2][i]}});
  }
  return box;
}

}  // namespace

void MediumPhotonMap::build(const std::vector<std::vector<Photon>>& chunks, const std::vector<float>& radii)
{
  std::vector<const Photon*> photons;
  Box3 bounds = box_empty();
  for (const std::vector<Photon>& chunk : chunks) {
    for (const Photon& photon : chunk) {
      photons.push_back(&photon);
      bounds = box_union(bounds, {photon.P, photon.P});
    }
  }
  const std::size_t count = photons.size();
  order_.resize(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    order_[i] = {curve_key(bounds, photons[i]->P), static_cast<std::uint32_t>(i)};
  });
  tbb::parallel_sort(order_.begin(), order_.end(), [](const Place& a, const Place& b) {
    return a.key != b.key ? a.key < b.key : a.number < b.number;
  });
  constexpr std::size_t kWidth = kPhotonTreeWidth;
  const auto groups = [](std::size_t n) { return (n + kWidth - 1) / kWidth; };
  for (std::vector<float>* column : {&x_, &y_, &z_}) column->assign(kWidth * groups(count), 0.0f);
  inverse_radius_squared_.assign(kWidth * groups(count), kInfinity);
  arrivals_.resize(count);
  num_levels_ = 0;
  if (count == 0) return;
  std::size_t num_boxes = groups(count);
  nodes_[0].resize(groups(num_boxes));
  tbb::parallel_for(std::size_t{0}, num_boxes, [&](std::size_t b) {
    Box3 box = box_empty();
    for (std::size_t i = kWidth * b; i < std::min(count, kWidth * (b + 1)); ++i) {
      const std::uint32_t number = order_[i].number;
      const Photon& photon = *photons[number];
      x_[i] = photon.P.x;
      y_[i] = photon.P.y;
      z_[i] = photon.P.z;
      inverse_radius_squared_[i] = 1.0f / sqr(radii[number]);
      arrivals_[i] = photon.arrival;
      // A little more, for the rounding of distances.
      const Vec3f reach = splat3(1.001f * radii[number]) + 1e-6f * abs(photon.P);
      box = box_union(box, {photon.P - reach, photon.P + reach});
    }
    set_box(nodes_[0][b / kWidth], b % kWidth, box);
  });
  for (num_levels_ = 1; nodes_[static_cast<std::size_t>(num_levels_) - 1].size() > 1; ++num_levels_) {
    const auto level = static_cast<std::size_t>(num_levels_);
    const std::size_t below = num_boxes;
    num_boxes = nodes_[level - 1].size();
    nodes_[level].resize(groups(num_boxes));
    for (std::size_t b = 0; b < num_boxes; ++b) {
      const Box3 box = box_around(nodes_[level - 1][b], std::min(kWidth, below - kWidth * b));
      set_box(nodes_[level][b / kWidth], b % kWidth, box);
    }
  }
}

MediumPhotonsView MediumPhotonMap::view() const
{
  MediumPhotonsView v;
  v.x = x_.data();
  v.y = y_.data();
  v.z = z_.data();
  v.inverse_radius_squared = inverse_radius_squared_.data();
  v.arrivals = arrivals_.data();
  v.num_photons = static_cast<std::uint32_t>(arrivals_.size());
  v.num_levels = num_levels_;
  for (int level = 0; level < num_levels_; ++level) {
    v.nodes[level] = nodes_[static_cast<std::size_t>(level)].data();
  }
  return v;
}

std::size_t MediumPhotonMap::bytes() const
{
  std::size_t bytes =
      arrivals_.capacity() * (sizeof(PhotonArrival) + 4 * sizeof(float)) + order_.capacity() * sizeof(Place);
  for (const std::vector<PhotonBoxes>& level : nodes_) bytes += level.capacity() * sizeof(PhotonBoxes);
  return bytes;
}

}  // namespace relief

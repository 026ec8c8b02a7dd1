// Lobes of eight hits in columns: a column is one lobe of each, all of one kind, though some hits may not have it. Most materials are
// two or three columns: a diffuse base, a reflection, a coat or sheen. Closures that resolve eight hits at once make them
// (plain_lanes.h, principled3_lanes.h, principled4_lanes.h), or they are taken from the lists that mixture_make.h makes;
// hit_columns.h evaluates and samples them.
#pragma once

#include <type_traits>

#include "kernel/bsdf/closure_lanes.h"

namespace relief {

/// As many as two Principled closures mostly need, or one and glass.
inline constexpr int kMostLobeColumns = 8;

/// What the lobes of a column have in common; see MixtureLobe.
struct LobeColumnKind {
  MixtureLobeKind kind = MixtureLobeKind::kLambert;
  Maths maths = Maths::k34;
  MixtureFresnel fresnel = MixtureFresnel::kNone;
  SmithMasking masking = SmithMasking::kSeparable;
  bool mirrors_below = false;
  bool is_beckmann = false;  ///< of what refracts
};

RELIEF_KERNEL bool operator==(const LobeColumnKind& a, const LobeColumnKind& b)
{
  // One comparison: it is asked of every lobe of a list, and its answers are hard to foretell.
  static_assert(std::has_unique_object_representations_v<LobeColumnKind>);
  return __builtin_memcmp(&a, &b, sizeof a) == 0;
}

struct alignas(32) LobeColumn {
  LobeColumnKind is;
  int frame = 0;                         ///< of LobeColumns
  int closure = 0;                       ///< of the material: what it was resolved of, if not taken from lists
  alignas(32) std::int32_t is_there[8];  ///< −1: the hit has such a lobe
  std::int32_t is_delta[8];              ///< likewise
  float probability[8], weight[3][8];    ///< 0 where it is not there
  float first_share[8];                  ///< as of MixtureLobe; of lobes of closures, which lists are made of
  float roughness[8];                    ///< perceptual; infinite: never sharp
  float shape[3][8];  ///< α along x and y; of diffuse Principled its roughness; of microfibres A, B, albedo
  float eta[8], F0[3][8], edge[3][8];  ///< as of MicrofacetFresnel; the edge of glass is the tint of what it reflects
  float through[3][8];                 ///< of glass: the tint of what it refracts
};

/// Frames about one normal of each hit.
struct alignas(32) LobeFrames {
  float frame[9][8], wo[3][8], surface_N[3][8];
  std::int32_t is_bent[8];  ///< −1: the normal is not the surface's
  bool is_lifted;           ///< wo is never below the horizon
};

struct LobeColumns {
  std::uint64_t closures = 0;  ///< of the material, that they are resolved of, bit by bit
  int num_lobes = 0, num_frames = 0;
  bool on_curves = false;              ///< as MixtureLobe::is_on_curve, of all
  LobeColumn lobes[kMostLobeColumns];  ///< in the order in which they are sampled
  LobeFrames frames[kMostLobeColumns];
};

/// Begins columns of which none is there.
RELIEF_KERNEL void lobe_columns_begin(LobeColumns& c)
{
  c.closures = 0;
  c.on_curves = false;
  c.num_lobes = c.num_frames = 0;
}

/// As diffuse closures see wo: as if from just above the horizon.
RELIEF_KERNEL Vec3x8 lifted(const Vec3x8& wo)
{
  return normalize(Vec3x8{wo.x, wo.y, max(wo.z, splat8(kLeastDiffuseCosine))});
}

/// Finds or adds frames about normals.
/// @param is_lifted  see LobeFrames
/// @return           their place
RELIEF_KERNEL int lobe_frames_add(LobeColumns& c, const MixtureBuildLanes& b, const Vec3x8& N, bool is_lifted = false)
{
  for (int i = 0; i < c.num_frames; ++i) {
    const Vec3x8 n = load8(c.frames[i].frame + 6);
    if (c.frames[i].is_lifted == is_lifted && mask_of((n.x == N.x) & (n.y == N.y) & (n.z == N.z)) == 0xffu) return i;
  }
  LobeFrames& f = c.frames[c.num_frames];
  const Frame8 frame = frame_from_normal(N);
  const Vec3x8 wo = to_local(frame, b.wo);
  store8(f.frame, frame);
  store8(f.wo, is_lifted ? lifted(wo) : wo);
  store8(f.surface_N, to_local(frame, b.Ns));
  store8(f.is_bent, ~(dot(N, b.Ns) > kUnbentLobe));
  f.is_lifted = is_lifted;
  return c.num_frames++;
}

/// Adds lobes, where they weigh anything, as mixture_add does one.
/// @param wanted  hits at which the closure has it
/// @return        diffuse and without parameters so far, sampled by its weight; null: none was added
RELIEF_KERNEL LobeColumn* lobe_column_add(LobeColumns& c,
                                          const LobeColumnKind& is,
                                          int frame,
                                          const Vec3x8& weight,
                                          I8 wanted)
{
  const Vec3x8 bounded = not_negative(weight);
  const F8 mean = mean_component(bounded), none = splat8(0.0f);
  I8 is_there = wanted & (mean > kLeastClosureWeight) & (mean < kInfinity);
  // What is seen lifted is seen from everywhere.
  if (is.kind != MixtureLobeKind::kLambert) is_there &= load8(c.frames[frame].wo[2]) > kMinCosine;
  if (mask_of(is_there) == 0) return nullptr;
  LobeColumn& lobe = c.lobes[c.num_lobes++];
  lobe.is = is;
  lobe.frame = frame;
  store8(lobe.is_there, is_there);
  store8(lobe.is_delta, I8{});
  store8(lobe.probability, is_there ? mean : none);
  store8(lobe.weight, select(is_there, bounded, Vec3x8{}));
  store8(lobe.roughness, splat8(kInfinity));
  store8(lobe.first_share, splat8(1.0f));
  return &lobe;
}

/// Makes lobes reflections by microfacets.
/// @param roughness  perceptual, in [0, 1]
/// @param eta, F0    of their reflectance
RELIEF_KERNEL void lobe_column_set_microfacets(LobeColumn& lobe,
                                               F8 roughness,
                                               F8 alpha_x,
                                               F8 alpha_y,
                                               F8 eta,
                                               const Vec3x8& F0)
{
  store8(lobe.roughness, roughness);
  store8(lobe.is_delta, roughness * roughness < kDeltaAlpha);
  store8(lobe.shape[0], alpha_x);
  store8(lobe.shape[1], alpha_y);
  store8(lobe.eta, eta);
  store8(lobe.F0, F0);
}

/// Multiplies their chances to be sampled. @param by  may be anything where there is no lobe
RELIEF_KERNEL void lobe_column_favour(LobeColumn& lobe, F8 by)
{
  store8(lobe.probability, load8(lobe.is_there) ? load8(lobe.probability) * by : splat8(0.0f));
}

/// Multiplies their weights, and their chances, likewise.
RELIEF_KERNEL void lobe_column_scale(LobeColumn& lobe, const Vec3x8& by)
{
  store8(lobe.weight, select(load8(lobe.is_there), multiplied(load8(lobe.weight), by), Vec3x8{}));
  lobe_column_favour(lobe, mean_component(by));
}

/// Whether indices match, of lobes that refract: see dielectric_is_matched.
RELIEF_KERNEL I8 lobe_column_is_matched(const LobeColumn& lobe) { return abs(load8(lobe.eta) - 1.0f) < kMatchedEta; }

/// As mixture_fresnel.
RELIEF_KERNEL Vec3x8 lobe_column_fresnel(const LobeColumn& lobe, F8 cos_d)
{
  const F8 one = splat8(1.0f);
  if (lobe.is.fresnel == MixtureFresnel::kInterpolated) {
    return fresnel_interpolated(load8(lobe.F0), cos_d, load8(lobe.eta));
  }
  if (lobe.is.fresnel == MixtureFresnel::kF82) return fresnel_f82(load8(lobe.F0), load8(lobe.edge), cos_d);
  if (lobe.is.fresnel == MixtureFresnel::kNone) return {one, one, one};
  const F8 F = fresnel_dielectric_at(cos_d, load8(lobe.eta));
  return {F, F, F};
}

/// Adds one hit's lobes to a list, as its closure would.
RELIEF_KERNEL void lobe_columns_list(const LobeColumns& c, int closure, int lane, MixtureBuild& b)
{
  MixtureLobes& all = *b.lobes;
  for (int i = 0; i < c.num_lobes; ++i) {
    const LobeColumn& column = c.lobes[i];
    if (column.closure != closure) continue;
    if (column.is_there[lane] == 0 || all.size == kMostMixtureLobes) continue;
    const LobeFrames& f = c.frames[column.frame];
    MixtureLobe& lobe = *new (&all.lobes[all.size++]) MixtureLobe;
    lobe.kind = column.is.kind;
    lobe.maths = column.is.maths;
    lobe.mirrors_below = column.is.mirrors_below;
    lobe.is_delta = column.is_delta[lane] != 0;
    lobe.roughness = column.roughness[lane];
    lobe.probability = column.probability[lane];
    lobe.first_share = column.first_share[lane];
    lobe.weight = load_lane(column.weight, lane);
    lobe.frame = {load_lane(f.frame, lane), load_lane(f.frame + 3, lane), load_lane(f.frame + 6, lane)};
    lobe.wo = load_lane(f.wo, lane);
    lobe.is_bent = f.is_bent[lane] != 0;
    if (lobe.is_bent) lobe.surface_N = load_lane(f.surface_N, lane);
    const MixtureTraits& traits = mixture_traits(lobe.kind);
    if (traits.sides != LobeSides::kReflect) b.transmits = true;
    const Vec3f shape = load_lane(column.shape, lane);
    const AnisotropicAlpha alpha{shape.x, shape.y};
    if (lobe.kind == MixtureLobeKind::kLambert) {
      lobe.wo = normalize(Vec3f{lobe.wo.x, lobe.wo.y, max(lobe.wo.z, kLeastDiffuseCosine)});
    } else if (lobe.kind == MixtureLobeKind::kPrincipledDiffuse) {
      lobe.shape.principled_diffuse = {shape.x};
    } else if (lobe.kind == MixtureLobeKind::kMicrofibre) {
      lobe.shape.microfibre = {shape.x, shape.y, shape.z};
    } else if (lobe.kind == MixtureLobeKind::kRefraction) {
      lobe.shape.refraction = {shape.x, column.eta[lane], column.is.is_beckmann, column.is.masking, false};
    } else if (traits.has_fresnel) {
      if (column.is.fresnel != MixtureFresnel::kNone) {
        lobe.fresnel = {column.is.fresnel, column.eta[lane], load_lane(column.F0, lane), {}, 1.0f, 0.0f};
      }
      if (column.is.fresnel == MixtureFresnel::kF82) lobe.fresnel.b = load_lane(column.edge, lane);
      if (lobe.kind == MixtureLobeKind::kGgx) {
        lobe.shape.ggx = {alpha, column.is.masking};
      } else if (lobe.kind == MixtureLobeKind::kBeckmann) {
        lobe.shape.beckmann = {alpha, column.is.masking};
      } else {
        lobe.shape.clearcoat = {shape.x};
      }
    }
  }
}

/// What column a lobe may stand in. @return  false: in none
RELIEF_KERNEL bool lobe_column_kind(const MixtureLobe& lobe, LobeColumnKind& is)
{
  if (lobe.is_on_curve) return false;
  is = {lobe.kind, lobe.maths};
  switch (lobe.kind) {
    case MixtureLobeKind::kLambert:
    case MixtureLobeKind::kTranslucent:
    case MixtureLobeKind::kPrincipledSheen:
    case MixtureLobeKind::kMicrofibre:
      return true;
    case MixtureLobeKind::kPrincipledDiffuse:
      return lobe.shape.principled_diffuse.part == PrincipledDiffusePart::kAll;
    case MixtureLobeKind::kGgx:
      is.masking = lobe.shape.ggx.masking;
      break;
    case MixtureLobeKind::kBeckmann:
      is.masking = lobe.shape.beckmann.masking;
      break;
    case MixtureLobeKind::kClearcoat:
      break;
    case MixtureLobeKind::kRefraction:
      is.masking = lobe.shape.refraction.masking;
      is.is_beckmann = lobe.shape.refraction.is_beckmann;
      return !lobe.shape.refraction.lights_unconnected;
    case MixtureLobeKind::kGlass:
      is.masking = SmithMasking::kCorrelated;
      is.is_beckmann = lobe.shape.glass.is_beckmann;
      break;
    default:
      return false;
  }
  is.fresnel = lobe.fresnel.kind;
  is.mirrors_below = lobe.mirrors_below;
  return is.fresnel == MixtureFresnel::kNone || is.fresnel == MixtureFresnel::kInterpolated ||
         is.fresnel == MixtureFresnel::kF82 || is.fresnel == MixtureFresnel::kDielectric;
}

/// One lobe of up to eight hits' lists. Null: a hit has none.
struct LobesAcross {
  const MixtureLobe* lobes[8];
};

/// Copies lobes to their column.
RELIEF_KERNEL void lobe_column_take(LobeColumn& column, const LobesAcross& from)
{
  store8(column.is_there, I8{});
  store8(column.is_delta, I8{});
  store8(column.probability, F8{});
  store8(column.weight, Vec3x8{});
  const auto visit = [&](auto&& copy) {
    for (int k = 0; k < 8; ++k) {
      if (from.lobes[k] != nullptr) copy(k, *from.lobes[k]);
    }
  };
  visit([&](int k, const MixtureLobe& lobe) {
    column.is_there[k] = -1;
    column.is_delta[k] = lobe.is_delta ? -1 : 0;
    column.probability[k] = lobe.probability;
    store_lane(column.weight, k, lobe.weight);
    column.roughness[k] = lobe.roughness;
  });
  if (column.is.kind == MixtureLobeKind::kPrincipledDiffuse) {
    visit([&](int k, const MixtureLobe& lobe) { column.shape[0][k] = lobe.shape.principled_diffuse.roughness; });
  } else if (column.is.kind == MixtureLobeKind::kMicrofibre) {
    visit([&](int k, const MixtureLobe& lobe) {
      const SheenMicrofibre& fibres = lobe.shape.microfibre;
      store_lane(column.shape, k, {fibres.A, fibres.B, fibres.albedo});
    });
  } else if (column.is.kind == MixtureLobeKind::kRefraction) {
    visit([&](int k, const MixtureLobe& lobe) {
      column.shape[0][k] = column.shape[1][k] = lobe.shape.refraction.alpha;
      column.eta[k] = lobe.shape.refraction.eta;
    });
  } else if (column.is.kind == MixtureLobeKind::kGlass) {
    visit([&](int k, const MixtureLobe& lobe) {
      column.shape[0][k] = column.shape[1][k] = lobe.shape.glass.alpha;
      column.eta[k] = lobe.fresnel.eta;
      store_lane(column.F0, k, lobe.fresnel.a);
      store_lane(column.edge, k, lobe.shape.glass.reflection_tint);
      store_lane(column.through, k, lobe.shape.glass.transmission_tint);
    });
  } else if (mixture_traits(column.is.kind).has_fresnel) {
    const MixtureLobeKind kind = column.is.kind;
    visit([&](int k, const MixtureLobe& lobe) {
      const float coat = lobe.shape.clearcoat.alpha;
      const AnisotropicAlpha alpha = kind == MixtureLobeKind::kGgx        ? lobe.shape.ggx.alpha
                                     : kind == MixtureLobeKind::kBeckmann ? lobe.shape.beckmann.alpha
                                                                          : AnisotropicAlpha{coat, coat};
      column.shape[0][k] = alpha.x;
      column.shape[1][k] = alpha.y;
      column.eta[k] = lobe.fresnel.eta;
      store_lane(column.F0, k, lobe.fresnel.a);
      store_lane(column.edge, k, lobe.fresnel.b);
    });
  }
}

/// Finds or adds the frames of a column's lobes.
/// @param owners  lobes whose frames the columns' are, by place
RELIEF_KERNEL int lobe_frames_take(LobeColumns& c, const LobesAcross& from, LobesAcross owners[kMostLobeColumns])
{
  // Lambert's lobe does not ask where wo is.
  const auto asks = [](const MixtureLobe& lobe) { return lobe.kind != MixtureLobeKind::kLambert; };
  const auto fits = [&](const MixtureLobe* own, const MixtureLobe* lobe) {
    return own == nullptr || lobe == nullptr ||
           (own->frame.n == lobe->frame.n && own->frame.s == lobe->frame.s &&
            (!asks(*own) || !asks(*lobe) || own->wo == lobe->wo));
  };
  int place = 0;
  for (; place < c.num_frames; ++place) {
    bool all_fit = true;
    for (int k = 0; k < 8 && all_fit; ++k) all_fit = fits(owners[place].lobes[k], from.lobes[k]);
    if (all_fit) break;
  }
  if (place == c.num_frames) {
    ++c.num_frames;
    for (const MixtureLobe*& own : owners[place].lobes) own = nullptr;
  }
  LobeFrames& f = c.frames[place];
  for (int k = 0; k < 8; ++k) {
    const MixtureLobe*& own = owners[place].lobes[k];
    const MixtureLobe* const lobe = from.lobes[k];
    if (lobe == nullptr || (own != nullptr && (asks(*own) || !asks(*lobe)))) continue;
    store_lane(f.wo, k, lobe->wo);
    if (own == nullptr) {
      store_lane(f.frame, k, lobe->frame.s);
      store_lane(f.frame + 3, k, lobe->frame.t);
      store_lane(f.frame + 6, k, lobe->frame.n);
      f.is_bent[k] = lobe->is_bent ? -1 : 0;
      if (lobe->is_bent) store_lane(f.surface_N, k, lobe->surface_N);
    }
    own = lobe;
  }
  return place;
}

/// Takes up to eight hits' lists of lobes.
/// @return  false: they are more, or others, than columns have
[[gnu::noinline]] RELIEF_KERNEL bool lobe_columns_take(LobeColumns& c, const MixtureLobes* lists, int count)
{
  LobesAcross from[kMostLobeColumns], owners[kMostLobeColumns];
  lobe_columns_begin(c);
  for (int k = 0; k < count; ++k) {
    int place = 0;
    for (int i = 0; i < lists[k].size; ++i) {
      LobeColumnKind is;
      if (!lobe_column_kind(lists[k].lobes[i], is)) return false;
      while (place < c.num_lobes && !(c.lobes[place].is == is)) ++place;
      if (place == kMostLobeColumns) return false;
      if (place == c.num_lobes) {
        c.lobes[c.num_lobes++].is = is;
        for (const MixtureLobe*& none : from[place].lobes) none = nullptr;
      }
      from[place++].lobes[k] = &lists[k].lobes[i];
    }
  }
  for (int i = 0; i < c.num_lobes; ++i) {
    c.lobes[i].frame = lobe_frames_take(c, from[i], owners);
    lobe_column_take(c.lobes[i], from[i]);
  }
  return true;
}

}  // namespace relief

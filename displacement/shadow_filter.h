// Asks the filter of shadow rays about hits that Embree has not found itself.
#pragma once

#include "displacement/embree_geometry.h"
#include "kernel/kernel.h"

namespace relief {

/// Whether a filter lets a shadow ray pass a hit.
/// @param lane    the ray's, of the packet in `arguments`
/// @param record  of the hit, as nearest hits have it
/// @param t       of the hit, in units of the ray's direction
RELIEF_KERNEL bool shadow_filter_passes(RTCFilterFunctionN filter,
                                        const RTCOccludedFunctionNArguments* arguments,
                                        unsigned lane,
                                        EmbreeHitRecord record,
                                        double t)
{
  RTCHit hit;
  hit.Ng_x = record.Ng_x;
  hit.Ng_y = hit.Ng_z = 0.0f;
  hit.u = record.u;
  hit.v = record.v;
  hit.primID = arguments->primID;
  hit.geomID = arguments->geomID;
  hit.instID[0] = arguments->context->instID[0];
  RTCRay ray = rtcGetRayFromRayN(arguments->ray, arguments->N, lane);
  ray.tfar = static_cast<float>(t);
  int valid = -1;
  RTCFilterFunctionNArguments asked;
  asked.valid = &valid;
  asked.geometryUserPtr = arguments->geometryUserPtr;
  asked.context = arguments->context;
  asked.ray = reinterpret_cast<RTCRayN*>(&ray);
  asked.hit = reinterpret_cast<RTCHitN*>(&hit);
  asked.N = 1;
  filter(&asked);
  return valid == 0;
}

}  // namespace relief

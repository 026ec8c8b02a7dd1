#include "integrator/graph_stop.h"

namespace relief {

constinit thread_local const std::atomic<bool>* graph_stop = nullptr;

}  // namespace relief

// The word to stop, for the interpreters of value graphs: one run of a large graph takes seconds. Of each thread, since graphs are
// run from deep inside of stages and of searches in computed heights.
#pragma once

#include <atomic>

namespace relief {

/// What ends runs of graphs on this thread; null: nothing does. Not inline: objects of several instruction sets read it.
extern constinit thread_local const std::atomic<bool>* graph_stop;

/// While one lives, graphs that this thread runs are given up once a flag is true. What they give then is not to be used.
class GraphStop {
 public:
  explicit GraphStop(const std::atomic<bool>* flag) : before_(graph_stop) { graph_stop = flag; }
  ~GraphStop() { graph_stop = before_; }
  GraphStop(const GraphStop&) = delete;
  GraphStop& operator=(const GraphStop&) = delete;

 private:
  const std::atomic<bool>* before_;
};

}  // namespace relief

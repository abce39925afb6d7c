// SPDX-License-Identifier: GPL-3.0-or-later
#include "search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "play.hpp"

namespace r4::simulation {
namespace {

// The faults that may follow in this run.
std::vector<Fault> next_faults(const Play& play, const std::vector<Fault>& faults) {
  std::vector<Fault> next;
  Fault first{0, Fault::Kind::lost};
  if (!faults.empty()) first = {faults.back().step, faults.back().kind};
  for (int step = first.step; step < static_cast<int>(play.steps().size()); ++step) {
    for (int k = 0; k < static_cast<int>(Fault::Kind::count); ++k) {
      const Fault fault{step, static_cast<Fault::Kind>(k)};
      if (!faults.empty() && step == first.step) {
        if (fault.kind <= first.kind) continue;
        if (is_of_datagram(fault.kind) && is_of_datagram(first.kind)) continue;
      }
      if (play.applies(fault)) next.push_back(fault);
    }
  }
  return next;
}

class Searcher {
 public:
  Searcher(const Story& story, int most_faults, std::uint32_t confirmed)
      : story_(story), most_faults_(most_faults), confirmed_(confirmed) {
    found.schedules.resize(static_cast<std::size_t>(most_faults) + 1);
  }
  void look(const std::vector<Fault>& faults) {
    Play play(story_, faults, false, confirmed_);
    const Report report = play.run();
    ++found.schedules[faults.size()];
    if (!report.violation.empty()) {
      const bool pushed = report.violation.starts_with("pushed");
      if (!pushed || is_strangers_doing(faults))
        found.findings.push_back({faults, report.violation});
      return;
    }
    if (static_cast<int>(faults.size()) == most_faults_) return;
    std::vector<Fault> more = faults;
    more.emplace_back();
    for (const Fault& fault : next_faults(play, faults)) {
      more.back() = fault;
      look(more);
    }
  }

  Search found;

 private:
  // True if the finding needs strangers, because delays and losses alone do not have the same
  // effect.
  bool is_strangers_doing(std::vector<Fault> faults) const {
    std::erase_if(faults, [](const Fault& fault) { return is_strangers(fault.kind); });
    return Play(story_, faults, false, {}, true).run().violation.empty();
  }

  const Story& story_;
  const int most_faults_;
  const std::uint32_t confirmed_;
};

}  // namespace

Search search(const Story& story, int most_faults) {
  Search sum;
  sum.schedules.resize(static_cast<std::size_t>(most_faults) + 1);
  Play play(story, {}, false);
  const Report report = play.run();
  sum.steps = play.steps().size();
  sum.schedules[0] = 1;
  if (!report.violation.empty()) {
    sum.findings.push_back({{}, report.violation});
    return sum;
  }
  const std::vector<Fault> firsts = most_faults == 0 ? std::vector<Fault>() : next_faults(play, {});
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  const auto work = [&] {
    Searcher searcher(story, most_faults, report.confirmed);
    for (std::size_t i = next++; i < firsts.size(); i = next++) searcher.look({firsts[i]});
    const std::lock_guard lock(mutex);
    for (std::size_t i = 0; i < sum.schedules.size(); ++i) {
      sum.schedules[i] += searcher.found.schedules[i];
    }
    std::move(searcher.found.findings.begin(), searcher.found.findings.end(),
              std::back_inserter(sum.findings));
  };
  std::vector<std::thread> threads;
  for (unsigned i = 0; i < std::max(1U, std::thread::hardware_concurrency()); ++i) {
    threads.emplace_back(work);
  }
  for (std::thread& thread : threads) thread.join();
  const auto key = [](const Finding& finding) {
    std::vector<int> numbers{static_cast<int>(finding.faults.size())};
    for (const Fault& fault : finding.faults) {
      numbers.push_back(fault.step);
      numbers.push_back(static_cast<int>(fault.kind));
    }
    return numbers;
  };
  std::sort(sum.findings.begin(), sum.findings.end(),
            [&](const Finding& a, const Finding& b) { return key(a) < key(b); });
  return sum;
}

std::map<std::string, FoundKind> kinds_of(const std::vector<Finding>& findings) {
  using Kinds = std::multiset<Fault::Kind>;
  std::map<std::string, FoundKind> kinds;
  std::vector<std::pair<std::size_t, Kinds>> before;
  for (const Finding& finding : findings) {  // findings with few faults come first
    const bool strange = std::any_of(finding.faults.begin(), finding.faults.end(),
                                     [](const Fault& fault) { return is_strangers(fault.kind); });
    Kinds all;
    std::string text = finding.violation.substr(0, finding.violation.find(':')) + ":";
    for (const Fault& fault : finding.faults) {
      if (!strange || is_strangers(fault.kind)) all.insert(fault.kind);
    }
    for (const Fault::Kind kind : all) text += fmt::format(" {}", word_of(kind));
    const bool implied = std::any_of(before.begin(), before.end(), [&](const auto& part) {
      return part.first < finding.faults.size() &&
             std::includes(all.begin(), all.end(), part.second.begin(), part.second.end());
    });
    if (implied) continue;
    before.emplace_back(finding.faults.size(), all);
    FoundKind& kind = kinds[text];
    if (kind.schedules++ == 0) kind.first = finding;
  }
  return kinds;
}

std::string tell(const Story& story, const Finding& finding) {
  Play play(story, finding.faults, true);
  play.run();
  std::string text = fmt::format("{}: {}\n", story.name, story.text);
  for (const Fault& fault : finding.faults) {
    const Step& step = play.steps().at(static_cast<std::size_t>(fault.step));
    text += fmt::format("  at {:.3f} s, datagram {}, {} {}, path {}, {}\n     {}\n",
                        static_cast<double>(step.at_us) / 1e6, fault.step,
                        step.to_board ? "from host" : "to host", step.host, step.path, step.text,
                        text_of(fault.kind));
  }
  return text +
         fmt::format("  breaks {}\n  again, with its trace: R4_STORY='{}' R4_STORY_FAULTS='{}'\n",
                     finding.violation, story.name, to_text(finding.faults));
}

}  // namespace r4::simulation

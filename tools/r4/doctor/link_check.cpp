// SPDX-License-Identifier: GPL-3.0-or-later
#include "link_check.hpp"

#include <fmt/format.h>

#include <asio/io_context.hpp>
#include <memory>
#include <utility>

#include "../bus/foreign_ids.hpp"
#include "../shell/options.hpp"
#include "can_checks.hpp"
#include "can_question.hpp"
#include "r4link/async_board.hpp"
#include "r4link/can/async_listener.hpp"
#include "r4link/can/can_interface.hpp"
#include "r4link/discovery/url.hpp"

namespace r4::tool {
namespace {

// More loss than much_loss may make a board time out. Less than some_loss is normal for WiFi.
constexpr double much_loss = 0.10;
constexpr double some_loss = 0.005;
// 1.5 periods of a state at 100 Hz.
constexpr double much_jitter_us = 15000;
// Replaces the missing bit rate of a virtual bus.
constexpr std::uint32_t doctor_bit_rate = 1'000'000;
// A board with a key refuses a host with a longer round trip.
constexpr double slow_answer_us = 250'000;
// Within this time a board can answer a question.
constexpr double asked_for_s = 1;

Finding found(const std::string& url, Severity severity, const char* check, std::string reason,
              std::string fix, ErrorKind kind = ErrorKind::data) {
  return {severity, check, url, std::move(reason), std::move(fix), Mending::by_hand, kind};
}

Finding trouble(const std::string& url, const Problem& problem) {
  return found(url, Severity::error, "link.open", problem.reason, problem.fix, problem.kind);
}

class Listening {
 public:
  Listening(asio::io_context& io, const std::string& url) : url_(url) {
    BoardOptions options;
    options.role = BoardRole::watch;
    options.session.arming = Arming::off;
    try {
      board_ = std::make_unique<AsyncBoard>(io, url, options);
      first_state_ = board_->on_state([this](const ReceivedState&, const Datagram&) {
        begun_ = board_->statistics();
        first_state_.cancel();
      });
      board_->open();
      const Url parsed = Url::parse(url);
      is_recording_ = parsed.scheme() == "replay";
      if (parsed.scheme() == "can") listen_to_bus(io, parsed);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::usage) throw;
      findings_.push_back(trouble(url, error.problem()));
      board_.reset();
    }
  }

  HeardLink end(double seconds) {
    HeardLink result{url_, {}, std::move(findings_)};
    if (!board_) return result;
    const Statistics statistics = board_->statistics();
    result.sample = {seconds,
                     statistics.received - begun_.received,
                     statistics.states - begun_.states,
                     statistics.packets.lost - begun_.packets.lost,
                     statistics.damaged - begun_.damaged,
                     statistics.jitter_us,
                     answered(statistics, seconds),
                     question_ ? question_->answer_us() : statistics.round_trip_min_us,
                     trouble_on_bus(),
                     explain(board_->name(), link())};
    if (statistics.received == 0 && statistics.damaged == 0) {
      const Problem problem = explain(board_->name(), board_->link());
      result.findings.push_back(found(url_, Severity::error, "link.silent", problem.reason,
                                      problem.fix, ErrorKind::refused));
    } else {
      result.findings = judge_link(url_, result.sample);
    }
    if (bus_) {
      const double load = static_cast<double>(bus_->survey().busy_ns()) / 1e9 / seconds;
      for (Finding& each : check_can_load(interface_, load))
        result.findings.push_back(std::move(each));
      // Late frames form no datagram, so their origin is unknown.
      if (result.sample.trouble != TransportTrouble::late_frames) {
        for (Finding& each : check_foreign_frames(bus_->survey(), interface_, node_))
          result.findings.push_back(std::move(each));
      }
    }
    return result;
  }

 private:
  // Adds the trouble that the question sees on the bus; the board itself is only watched.
  LinkStatus link() const {
    LinkStatus link = board_->link();
    if (!question_) return link;
    const TransportTrouble trouble = question_->trouble();
    link.causes.set(LinkCause::foreign_frames, trouble == TransportTrouble::foreign_frames);
    link.causes.set(LinkCause::late_frames, trouble == TransportTrouble::late_frames);
    return link;
  }
  TransportTrouble trouble_on_bus() const {
    return question_ ? question_->trouble() : TransportTrouble::none;
  }
  Answered answered(const Statistics& statistics, double seconds) const {
    const bool by_anyone =
        !board_->identity().board_id.empty() || (bus_ && bus_->survey().board(node_).answers != 0);
    if (statistics.round_trip_us > 0 || by_anyone) return Answered::yes;
    const bool asked = question_ ? question_->asked_since_s() >= asked_for_s
                                 : !is_recording_ && seconds >= asked_for_s;
    return asked || trouble_on_bus() != TransportTrouble::none ? Answered::no : Answered::not_asked;
  }
  void listen_to_bus(asio::io_context& io, const Url& url) {
    const std::string& name = can_interface_of(url);
    interface_ = name;
    node_ = static_cast<std::uint8_t>(url.get_number("node", 0, can_nodes - 1, 1));
    const CanInterface interface = can_interface(name);
    const std::uint32_t rate = interface.bit_rate != 0 ? interface.bit_rate : doctor_bit_rate;
    bus_ = std::make_unique<CanListener>(io, name, CanBitRate{rate, interface.data_bit_rate});
    question_ = std::make_unique<CanQuestion>(io, url.text());
    bus_->survey().on_datagram([this](std::uint8_t node, const Datagram& datagram) {
      if (node == node_) question_->hear(datagram);
    });
  }

  const std::string url_;
  std::string interface_;
  std::uint8_t node_ = 0;
  bool is_recording_ = false;
  Findings findings_;
  std::unique_ptr<AsyncBoard> board_;
  // Statistics begin at the first state: missing earlier packet numbers are not lost datagrams.
  Subscription first_state_;
  Statistics begun_;
  std::unique_ptr<CanQuestion> question_;
  std::unique_ptr<CanListener> bus_;
};

}  // namespace

Findings judge_link(const std::string& url, const LinkSample& sample) {
  Findings findings;
  const double all = static_cast<double>(sample.received + sample.lost + sample.damaged);
  const double loss = all > 0 ? static_cast<double>(sample.lost) / all : 0;
  if (sample.damaged > 0) {
    findings.push_back(found(
        url, Severity::warning, "link.damaged",
        fmt::format("{} datagrams were damaged: the wiring or the baud rate is wrong, or another "
                    "program reads the port",
                    sample.damaged),
        fmt::format("r4 monitor {} --json", url)));
  }
  if (loss >= some_loss) {
    const bool much = loss >= much_loss;
    findings.push_back(found(
        url, much ? Severity::error : Severity::warning, "link.loss",
        fmt::format("{} of {:.0f} datagrams are lost, {:.1f} %{}", sample.lost, all, 100 * loss,
                    much ? ": heartbeats are also lost, so the board goes safe" : ""),
        fmt::format("r4 bench {}", url), ErrorKind::refused));
  }
  if (sample.jitter_us > much_jitter_us) {
    findings.push_back(found(
        url, Severity::warning, "link.jitter",
        fmt::format("states arrive {:.1f} ms early or late on average", sample.jitter_us / 1000),
        fmt::format("r4 bench {}", url)));
  }
  if (sample.states == 0) {
    findings.push_back(
        found(url, Severity::error, "link.states",
              fmt::format("{} datagrams arrived in {:.1f} s, but no state: {}", sample.received,
                          sample.seconds, sample.link.reason),
              sample.link.fix.empty() ? fmt::format("r4 monitor {} --json", url) : sample.link.fix,
              ErrorKind::refused));
  }
  if (sample.answered == Answered::no) {
    const bool known = sample.trouble != TransportTrouble::none;
    findings.push_back(found(
        url, Severity::error, "link.answer",
        known ? sample.link.reason
              : "the board does not answer: it does not receive datagrams from this computer",
        known ? sample.link.fix
              : "check the connection to the board (its RX wire, a firewall): r4 bench " + url,
        ErrorKind::refused));
  } else if (sample.answer_us > slow_answer_us) {
    findings.push_back(found(url, Severity::warning, "link.answer",
                             fmt::format("the board answers after {:.0f} ms: commands take effect "
                                         "late, and a board with a key refuses them",
                                         sample.answer_us / 1000),
                             fmt::format("r4 bench {}", url)));
  }
  if (findings.empty()) {
    const bool answered = sample.answered == Answered::yes;
    std::string answer = answered ? "the board answers" : "the board was not asked for an answer";
    if (sample.answer_us > 0) answer += fmt::format(" in {:.1f} ms", sample.answer_us / 1000);
    findings.push_back(found(
        url, answered ? Severity::ok : Severity::note, "link",
        fmt::format("{} states in {:.1f} s, {} lost, 0 damaged, jitter "
                    "{:.1f} ms; {}",
                    sample.states, sample.seconds, sample.lost, sample.jitter_us / 1000, answer),
        ""));
  }
  return findings;
}

std::vector<HeardLink> listen_to_links(const std::vector<std::string>& urls,
                                       std::chrono::milliseconds duration) {
  asio::io_context io(1);
  std::vector<std::unique_ptr<Listening>> links;
  links.reserve(urls.size());
  for (const std::string& url : urls) links.push_back(std::make_unique<Listening>(io, url));
  const auto begun = std::chrono::steady_clock::now();
  if (!links.empty()) io.run_for(duration);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  std::vector<HeardLink> heard;
  heard.reserve(links.size());
  for (const auto& each : links) heard.push_back(each->end(seconds));
  return heard;
}

}  // namespace r4::tool

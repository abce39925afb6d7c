// SPDX-License-Identifier: GPL-3.0-or-later
#include "host_lookup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <asio/ip/udp.hpp>
#include <asio/post.hpp>
#include <exception>
#include <future>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

namespace r4 {
namespace {

// Calls `done(answer)` in a detached thread, which may outlive all objects except the arguments.
template <class Done>
void ask_in_a_thread(const HostWatch::Question& question, Done done) {
  // An exception that leaves the thread would end the program, which may be driving.
  const auto ask = [question] {
    try {
      return question();
    } catch (const std::exception& error) {
      return FoundHost{{}, error.what()};
    }
  };
  try {
    std::thread([ask, done] { done(ask()); }).detach();
  } catch (const std::system_error& error) {
    done(FoundHost{{}, error.what()});
  }
}

}  // namespace

FoundHost HostLookup::ask_system(const std::string& host) {
  asio::io_context io(1);
  asio::error_code error;
  const auto results = asio::ip::udp::resolver(io).resolve(host, "", error);
  FoundHost found;
  for (const auto& result : results) found.addresses.push_back(result.endpoint().address());
  if (found.addresses.empty()) found.reason = error.message();
  return found;
}

FoundHost HostLookup::find(const std::string& host) const {
  if (is_address(host)) return {{asio::ip::make_address(host)}, ""};
  const auto answer = std::make_shared<std::promise<FoundHost>>();
  std::future<FoundHost> found = answer->get_future();
  ask_in_a_thread([ask = resolve, host] { return ask(host); },
                  [answer](FoundHost each) { answer->set_value(std::move(each)); });
  if (found.wait_for(patience) == std::future_status::ready) return found.get();
  return {{}, "the name server does not answer"};
}

asio::ip::address address_of(const FoundHost& found, const std::string& host,
                             const std::string& thing) {
  if (found.problem) {
    throw Error(found.problem->kind, thing, found.problem->reason, found.problem->fix);
  }
  if (found.addresses.empty()) {
    throw Error(ErrorKind::open, thing,
                fmt::format("the host '{}' was not found ({})", host, found.reason),
                "check the name, or give the IP address");
  }
  const auto v4 = std::find_if(found.addresses.begin(), found.addresses.end(),
                               [](const asio::ip::address& each) { return each.is_v4(); });
  asio::ip::address address = v4 != found.addresses.end() ? *v4 : found.addresses.front();
  if (address.is_multicast() || address == asio::ip::address_v4::broadcast()) {
    throw Error(ErrorKind::usage, thing, host + " is a multicast or broadcast address",
                "give the IP address of one board");
  }
  return address;
}

bool is_address(const std::string& host) {
  asio::error_code error;
  asio::ip::make_address(host, error);
  return !error;
}

// The asker and its loop may be destroyed before the answer arrives.
struct HostWatch::Asked {
  std::mutex mutex;
  HostWatch* asker = nullptr;
};

HostWatch::HostWatch(asio::io_context& io, HostLookup lookup, std::function<Question()> question,
                     OnFound on_found)
    : io_(io),
      lookup_(std::move(lookup)),
      question_(std::move(question)),
      on_found_(std::move(on_found)),
      timer_(io) {}

void HostWatch::start(bool known) {
  stop();
  known_ = known;
  if (!known) ask();
  wait();
}

void HostWatch::stop() {
  waiting_.cancel();
  timer_.cancel();
  heard_ = true;
  if (!asked_) return;
  {
    const std::lock_guard lock(asked_->mutex);
    asked_->asker = nullptr;
  }
  asked_.reset();
}

void HostWatch::ask() {
  if (asked_) return;
  const Question question = question_();
  if (!question) {
    known_ = on_found_({});
    return;
  }
  asked_ = std::make_shared<Asked>();
  asked_->asker = this;
  ask_in_a_thread(question, [asked = asked_](const FoundHost& found) {
    const std::lock_guard lock(asked->mutex);
    if (asked->asker == nullptr) return;
    asio::post(asked->asker->io_, [asked, found] {
      HostWatch* const asker = asked->asker;  // only the thread of the loop writes it
      if (asker == nullptr) return;
      asker->asked_.reset();
      asker->known_ = asker->on_found_(found);
    });
  });
}

// The timer also keeps the loop running while an answer is under way.
void HostWatch::wait() {
  timer_.expires_after(known_ ? lookup_.silence : lookup_.retry);
  timer_.async_wait(waiting_.handler([this] {
    const bool silent = !known_ || !heard_;
    heard_ = !known_;
    wait();
    if (silent) ask();
  }));
}

}  // namespace r4

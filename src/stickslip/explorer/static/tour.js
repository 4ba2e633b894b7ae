"use strict";
/* Five questions, each with a rig to begin with. `rig` changes the teaching bench; `solved` judges a run by what the
   server said of it; the trace of the beginning stays in grey, to compare with. */

const Tour = (() => {
  const kind = (run, ...kinds) => kinds.includes(run.regime.kind);
  const only = (run, begin, key) => {
    const differs = (name) => Fields.at(run.asked, name) !== Fields.at(begin, name);
    return ["slider.stiffness", "drive.velocity", "slider.mass", "interface.delay", "interface.thresholds.std"]
      .every((name) => name === key || !differs(name)) && differs(key);
  };
  const count = (document) => Fields.at(document, "simulation.contacts");

  const QUESTIONS = [
    { title: "1 of 5: make it stick",
      question: "This block slides smoothly on its stiff spring. Make it stick and slip by one parameter: the driving spring, K.",
      rig: { "slider.stiffness": "10 kN/m" },
      solved: (run, begin) => kind(run, "stick-slip") && only(run, begin, "slider.stiffness"),
      answer: "A soft spring cannot let go as fast as the contacts do: once many break together, the block jumps." },
    { title: "2 of 5: stop it with the spring",
      question: "Now it sticks and slips. How stiff must the spring be until the slips are gone? Find the softest one.",
      rig: {},
      solved: (run, begin) => kind(run, "smooth sliding") && only(run, begin, "slider.stiffness"),
      answer: "Above the critical stiffness the spring takes up what the contacts give. The grey trace is how it was before; the map shows the limit." },
    { title: "3 of 5: stop it with speed",
      question: "The same block in oil (more damping). Leave the spring alone, and make it slide smoothly by the speed of the drive only.",
      rig: { "slider.damping_ratio": 0.3 },
      solved: (run, begin) => kind(run, "smooth sliding") && only(run, begin, "drive.velocity"),
      answer: "When the block moves more than a breaking displacement within the delay, fewer contacts hold at any time, and they no longer break together." },
    { title: "4 of 5: what is the noise?",
      question: "This slides smoothly, and yet the force is rough: it rests on 100 contacts. Is that stick-slip? Take 10 000 contacts (N) and compare.",
      rig: { "slider.stiffness": "10 kN/m", "simulation.contacts": 100 },
      solved: (run) => kind(run, "smooth sliding") && count(run.asked) >= 9000,
      answer: "It was noise: contacts break one by one, and their force varies as 1/√N. A hundred times the contacts, a tenth of the noise." },
    { title: "5 of 5: what does N do to the slips?",
      question: "Stick-slip again, with 1000 contacts. Take 100 or 10 000: do the slips become smaller or rarer?",
      rig: {},
      solved: (run, begin) => kind(run, "stick-slip") && (count(run.asked) >= 10 * count(begin) || count(run.asked) <= 0.1 * count(begin)),
      answer: "Hardly: the slips of stick-slip are made by all contacts together, and stay. Only noise depends on N." },
  ];

  function begin(bench, index) {
    const document = structuredClone(bench);
    for (const [key, value] of Object.entries(QUESTIONS[index].rig)) Fields.put(document, key, value);
    return document;
  }
  return { QUESTIONS, begin };
})();

// Sorts a table by the column whose head is clicked; the next click turns the order round.
for (const head of document.querySelectorAll(".points th")) {
  head.addEventListener("click", () => {
    const body = head.closest("table").tBodies[0];
    const column = head.cellIndex;
    const down = head.dataset.down !== "yes";
    head.dataset.down = down ? "yes" : "no";
    const key = (row) => row.cells[column].textContent;
    const order = (a, b) => {
      const difference = parseFloat(key(a)) - parseFloat(key(b));
      return Number.isNaN(difference) ? key(a).localeCompare(key(b)) : difference;
    };
    const rows = [...body.rows].sort((a, b) => (down ? order(a, b) : order(b, a)));
    body.append(...rows);
  });
}
// The most exact point of each front that fits into the time asked for.
const budget = document.getElementById("budget");
budget.addEventListener("input", () => {
  const most = parseFloat(budget.value);
  if (Number.isNaN(most)) return;
  for (const row of document.querySelectorAll("#answers tr")) {
    const fitting = fronts[row.dataset.curve].filter((point) => point.ms <= most);
    while (row.cells.length > 2) row.deleteCell(2);
    row.insertAdjacentHTML(
      "beforeend",
      fitting.length ? fitting[fitting.length - 1].cells : "<td>none: switch it off</td><td></td><td></td><td></td>",
    );
  }
});

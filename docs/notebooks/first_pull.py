# %% [markdown]
# # First pull
# The liver phantom is pulled at its left lobe: force with its error, mesh, time.

# %%
import yawara

simulation = yawara.Simulation("liver", {"time.steps": 6})
for row in simulation.plan:
    print(f"{row['stage']:20} {row['choice']:20} {'yes' if row['runs'] else 'no'}")

# %%
for _ in range(6):
    report = simulation.step()
    grab = report.tools[0]
    size = float((grab.force_n @ grab.force_n) ** 0.5)
    error = f" +- {grab.force_error_n:.3f}" if grab.force_error_n is not None else ""
    print(f"{report.time_s:.2f} s  {size:.3f}{error} N  {report.vertices} vertices  {sum(report.times_ms.values()):.1f} ms")
    assert report.converged

# %%
assert size > 0.1 and report.vertices > 100
frame = simulation.frame
print(frame.positions.shape, frame.von_mises_pa.max(), "Pa at most")

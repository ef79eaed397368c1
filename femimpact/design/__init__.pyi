from femimpact.design.ball import damper_curve as damper_curve
